"""check_vehicle passes a simulated rover of each make, and names what is wrong with a broken one.

In virtual time over the whole contract, with everything that it may do to a rover.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.messages import Message
from rover_sim.check_vehicle.context import Options
from rover_sim.check_vehicle.report import Outcome
from rover_sim.faults import Faults
from rover_sim.modes import Mode
from rover_sim.personas import ARDUPILOT, PERSONAS, PX4
from tests.unit.rover_sim.rig import VirtualWire, run

ALL = Options(arm=True, drive=True, write=True)
NOTHING = Options()
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, ARM_DISARM = 512, 511, 400
MOTION = (m.SetPositionTargetLocalNed, m.SetPositionTargetGlobalInt)


def test_a_simulated_rover_of_each_make_passes() -> None:
    for name in PERSONAS:
        wire = VirtualWire(PERSONAS[name])
        report = run(wire, ALL)
        assert [str(line) for line in report.failed] == []
        assert [line.name for line in report.lines if line.outcome is Outcome.SKIPPED] == []
        assert sum(line.outcome is Outcome.OK for line in report.lines) >= 80
        assert not wire.vehicle.autopilot.armed
        assert wire.vehicle.autopilot.mode is Mode.HOLD
        assert abs(wire.vehicle.truth.forward_speed) < 0.05
        assert math.hypot(wire.vehicle.truth.north, wire.vehicle.truth.east) > 2.0  # it did drive


def test_by_default_it_neither_arms_nor_moves_nor_changes_what_is_stored() -> None:
    for persona in PERSONAS.values():
        wire = VirtualWire(persona)
        before = wire.vehicle.autopilot.mode
        assert run(wire, NOTHING).failed == []
        commands = {each.command for each in wire.asked if isinstance(each, m.CommandLong)}
        assert commands == {REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, 510, 176, 31_999}
        stored = (m.MissionCount, m.MissionItemInt, m.MissionClearAll)
        assert not any(isinstance(each, stored) for each in wire.asked)
        assert all((each.vx, each.vy) == (0.0, 0.0) for each in wire.setpoints)
        after = Mode.MANUAL if before is Mode.INITIALISING else before
        assert wire.vehicle.autopilot.mode is after  # as it was
        assert (wire.vehicle.truth.north, wire.vehicle.truth.east) == (0.0, 0.0)


# -- broken rovers


@dataclass(frozen=True)
class Fault:
    """A way to be broken, and the lines that must say so: no more and no fewer, of these groups."""

    groups: tuple[str, ...]
    lines: str
    says: Callable[[Message], Iterable[Message]] = lambda message: [message]
    hears: Callable[[Message], Message | None] = lambda message: message
    options: Options = NOTHING


def with_fields(kind: type[Message], **fields: object) -> Callable[[Message], list[Message]]:
    def change(message: Message) -> list[Message]:
        if isinstance(message, kind):
            for name, value in fields.items():
                new = value(getattr(message, name)) if callable(value) else value
                setattr(message, name, new)
        return [message]

    return change


def no_refusals(message: Message) -> list[Message]:
    silent = isinstance(message, m.CommandAck) and message.result != 0
    return [] if silent else [message]


def twice(message: Message) -> list[Message]:
    return [message, message] if isinstance(message, m.CommandAck) else [message]


def takes_commands_of_others(message: Message) -> Message:
    if isinstance(message, m.CommandLong):
        message.target_system = 1
    return message


def no_body_frame(message: Message) -> Message | None:
    return None if isinstance(message, MOTION) and message.coordinate_frame == 8 else message


def a_parameter_missing(message: Message) -> list[Message]:
    lost = isinstance(message, m.ParamValue) and message.param_index == 26
    return [] if lost else [message]


IDENTITY, TELEMETRY, COMMANDS = ("identity",), ("identity", "telemetry"), ("identity", "commands")
PARAMETERS, PLANS, MODES = ("parameters",), ("identity", "plans"), ("modes",)
FAULTS: dict[str, Fault] = {
    "silence instead of a refusal": Fault(
        COMMANDS,
        "PROTOCOL_VERSION on request; COMPONENT_METADATA on request; AVAILABLE_MODES; "
        "COMPONENT_INFORMATION on request; an unknown message; an unknown command; "
        "an unknown COMMAND_INT",
        says=no_refusals,
    ),
    "acks twice": Fault(COMMANDS, "one ack, from the target", says=twice),
    "obeys what is for others": Fault(
        COMMANDS, "a command for another system", hears=takes_commands_of_others
    ),
    "degrees for radians": Fault(
        TELEMETRY,
        "ATTITUDE; one heading",
        says=with_fields(m.Attitude, yaw=math.degrees),
    ),
    "a parameter that never comes": Fault(
        PARAMETERS, "indices", says=a_parameter_missing
    ),
    "a mode that is not shown": Fault(
        MODES,
        "enter HOLD; enter the control mode; SET_MODE message",
        says=with_fields(m.Heartbeat, custom_mode=0),
    ),
    "no frame of its own": Fault(
        ("driving",),
        "velocity in BODY_NED; yaw rate in BODY_NED; backwards in BODY_NED",
        hears=no_body_frame,
        options=ALL,
    ),
}  # fmt: skip


def test_what_is_wrong_is_named_and_nothing_else() -> None:
    for name, fault in FAULTS.items():
        wire = VirtualWire(ARDUPILOT, says=fault.says, hears=fault.hears)
        report = run(wire, fault.options, fault.groups)
        assert {line.name for line in report.failed} == set(fault.lines.split("; ")), name
        for line in report.failed:
            assert "expected" in line.said
            assert "seen" in line.said


# -- whatever happens while it drives


def while_driving(do: Callable[[VirtualWire], None]) -> Callable[[VirtualWire], None]:
    done: list[bool] = []

    def at(wire: VirtualWire) -> None:
        if not done and wire.vehicle.truth.forward_speed > 0.4:
            done.append(True)
            do(wire)

    return at


def break_down(_wire: VirtualWire) -> None:
    raise RuntimeError("a fault of our own")


def test_it_ends_with_zeros_hold_and_disarmed() -> None:
    for name in PERSONAS:
        wire = VirtualWire(PERSONAS[name], at=while_driving(break_down))
        with pytest.raises(RuntimeError):
            run(wire, ALL, ("driving",))
        last = wire.setpoints[-1]
        assert (last.vx, last.vy, last.yaw_rate) == (0.0, 0.0, 0.0)
        assert wire.vehicle.autopilot.mode is Mode.HOLD
        assert not wire.vehicle.autopilot.armed


def test_a_rover_that_somebody_else_takes_gets_no_other_motion() -> None:
    def take(wire: VirtualWire) -> None:
        wire.vehicle.autopilot.operator_mode(Mode.MANUAL, now=wire.now())
        wire.setpoints.clear()

    for persona in PERSONAS.values():
        wire = VirtualWire(persona, at=while_driving(take))
        (line,) = run(wire, ALL, ("driving",)).failed
        assert "it left the control mode" in line.said
        late = [each for each in wire.setpoints if (each.vx, each.vy) != (0.0, 0.0)]
        assert len(late) <= 21  # those of the second until the next heartbeat


def test_it_does_not_drive_blind() -> None:
    for kind, named in ((m.Heartbeat, "no heartbeat"), (m.LocalPositionNed, "no LOCAL_POSITION")):
        lost = Faults(withheld=frozenset({kind.id}))
        lose = while_driving(lambda wire: wire.vehicle.autopilot.set_faults(lost))  # noqa: B023
        wire = VirtualWire(ARDUPILOT, at=lose)
        assert any(named in line.said for line in run(wire, ALL, ("driving",)).failed)
        assert wire.vehicle.autopilot.mode is Mode.HOLD
        assert not wire.vehicle.autopilot.armed


# -- what genuine ones do, and what is no fault


def tells_of_a_change(message: Message) -> list[Message]:
    """A PARAM_VALUE without an index, as a genuine one sends unasked, before each of the list."""
    if not isinstance(message, m.ParamValue) or message.param_index == 65535:
        return [message]
    return [m.ParamValue(b"_HASH_CHECK", 0.0, 5, message.param_count, 65535), message]


def test_what_genuine_ones_do_is_no_fault() -> None:
    for persona, says in [
        (ARDUPILOT, with_fields(m.ExtendedSysState, landed_state=0)),
        (PX4, with_fields(m.VfrHud, airspeed=math.nan)),  # it has no sensor of it
        (PX4, tells_of_a_change),
    ]:
        report = run(VirtualWire(persona, says=says), NOTHING)
        assert [str(line) for line in report.failed] == []
