"""Which parameters say what a rover does when it is left alone, and how they are read.

MAVLink guide, "Parameter Protocol": an integer stands in a float by its bytes, or cast to one.
"""

from math import isnan
from struct import pack, unpack

from mav_tasks.engine.services.loss_failsafe import AFTER, what_it_does
from mav_tasks.engine.services.own_parameters import OwnParameters
from mav_tasks.engine.services.persona import Persona
from mav_tasks.mavlink import messages as m
from mav_tasks.probe.conversation import Conversation
from mav_tasks.probe.findings import Findings
from mav_tasks.probe.steps import Steps, Wait

BYTEWISE = 16  # MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
FORMATS = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}  # by MAV_PARAM_TYPE
ASKS, ASK_AGAIN = 3, 0.4  # s
#: what an ArduPilot Rover does, whatever its parameters say
FIXED = "stops 3 s after the last setpoint, as ArduPilot does (fixed; observed on 4.6.3)"
UNREPORTED = "does not report whether it stops when setpoints stop"


def ask_parameters(talk: Conversation, findings: Findings) -> Steps[None]:
    """Read those that matter for the rover's make; who lacks one does not answer."""
    persona = talk.persona
    if persona is None:
        return
    names = persona.probed_parameters + persona.turning_parameters
    for _ in range(ASKS):
        missing = [name for name in names if name not in talk.parameters]
        for name in missing:
            talk.send(m.ParamRequestRead(*talk.target, name.encode(), -1))
        yield Wait(lambda: all(name in talk.parameters for name in names), ASK_AGAIN)
    is_bytewise = persona.has_bytewise_parameters
    if findings.capabilities is not None:
        is_bytewise = bool(findings.capabilities & BYTEWISE)
    for name in names:
        value = talk.parameters.get(name)
        if value is None:
            findings.missing_parameters.append(name)
        else:
            findings.parameters[name] = value_of(value, is_bytewise=is_bytewise)
    findings.loss_by_parameters = FIXED
    said = own_parameters_of(talk, persona)
    if persona.has_loss_failsafe:
        findings.loss_by_parameters = what_it_does(said.values) or UNREPORTED
    findings.turning = "" if said.turning is None else said.turning.value
    findings.turning_radius = said.turning_radius


def value_of(message: m.ParamValue, *, is_bytewise: bool) -> float:
    form = FORMATS.get(message.param_type)
    if not is_bytewise or form is None:
        return float(message.param_value)
    (number,) = unpack(form, pack("<f", message.param_value))
    return float(number)


def own_parameters_of(talk: Conversation, persona: Persona) -> OwnParameters:
    """Return what the server, too, reads in the parameters."""
    said = OwnParameters(talk.target, persona)
    for message in talk.parameters.values():
        said.receive(message)
    return said


def loss_time_of(findings: Findings) -> float:
    """Return the seconds after which it is to stop without setpoints, as far as it says."""
    after = findings.parameters.get(AFTER, 3.0)
    return 3.0 if isnan(after) else after
