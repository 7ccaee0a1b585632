"""Sets a rover's loss failsafe so that it stands when setpoints stop: the one thing that a probe
changes for good, and only when it is asked to.
"""

from struct import pack, unpack

from mav_tasks.engine.services.loss_failsafe import STANDING, fault_in, what_it_does
from mav_tasks.mavlink import messages as m
from mav_tasks.probe.conversation import Conversation
from mav_tasks.probe.findings import Findings
from mav_tasks.probe.parameters import (
    BYTEWISE,
    FORMATS,
    ask_parameters,
    own_parameters_of,
    value_of,
)
from mav_tasks.probe.steps import Steps, Wait

ASKS, ASK_AGAIN = 5, 0.5  # s


class NotSet(Exception):
    """The rover does not take it; the text says what."""


def set_failsafe(talk: Conversation, findings: Findings) -> Steps[None]:
    """Have it stand when setpoints stop, and change nothing where it does already."""
    yield from ask_parameters(talk, findings)
    persona = talk.persona
    if persona is None or not persona.has_loss_failsafe:
        findings.failsafe_set = "nothing to set"
        return
    done: list[str] = []
    while name := fault_in(own_parameters_of(talk, persona).values)[0]:
        before, wanted = findings.parameters[name], STANDING[name]
        yield from _set(talk, findings, name, wanted)
        done.append(f"{name} {before:g}, now {wanted:g}")
    findings.loss_by_parameters = what_it_does(own_parameters_of(talk, persona).values)
    if not findings.loss_by_parameters:
        raise NotSet("the rover does not report what it does when setpoints stop")
    findings.failsafe_set = "; ".join(done) or "nothing to change"


def _set(talk: Conversation, findings: Findings, name: str, wanted: float) -> Steps[None]:
    kind = talk.parameters[name].param_type
    flags = BYTEWISE if findings.capabilities is None else findings.capabilities
    is_bytewise = bool(flags & BYTEWISE)
    wire, form = wanted, FORMATS.get(kind)
    if is_bytewise and form is not None:
        (wire,) = unpack("<f", pack(form, int(wanted)))

    def is_set() -> bool:
        return value_of(talk.parameters[name], is_bytewise=is_bytewise) == wanted

    for _ in range(ASKS):
        talk.send(m.ParamSet(*talk.target, name.encode(), wire, kind))
        came = yield Wait(is_set, ASK_AGAIN)
        if came:
            findings.parameters[name] = wanted
            return
    raise NotSet(f"the rover does not accept {name} {wanted:g}")
