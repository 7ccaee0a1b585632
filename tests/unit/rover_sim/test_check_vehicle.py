"""check_vehicle passes a simulated rover of each make, and names what is wrong with a broken one.

In virtual time over the whole contract, with everything that it may do to a rover.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.check_vehicle.context import Options
from rover_sim.check_vehicle.report import Outcome
from rover_sim.faults import Faults
from rover_sim.modes import Mode
from rover_sim.personas import ARDUPILOT, PERSONAS, PX4, Persona
from rover_sim.px4_parameters import Bytewise
from tests.unit.rover_sim.virtual_wire import VirtualWire, run

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
    for name in PERSONAS:
        asked: list[Message] = []

        def hears(message: Message) -> Message:
            asked.append(message)
            return message

        wire = VirtualWire(PERSONAS[name], hears=hears)
        before = wire.vehicle.autopilot.mode
        values = dict(wire.vehicle.autopilot.parameters._values)
        report = run(wire, NOTHING)
        assert report.failed == []
        commands = {each.command for each in asked if isinstance(each, m.CommandLong)}
        assert commands == {REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, 510, 176, 31_999}
        stored = (m.MissionCount, m.MissionItemInt, m.MissionClearAll)
        assert not any(isinstance(each, stored) for each in asked)
        assert all((each.vx, each.vy) == (0.0, 0.0) for each in wire.setpoints)
        # the one that was set to what it is went through a float of 32 bits
        assert wire.vehicle.autopilot.parameters._values == pytest.approx(values, rel=1e-6)
        after = Mode.MANUAL if before is Mode.INITIALISING else before
        assert wire.vehicle.autopilot.mode is after  # as it was
        assert (wire.vehicle.truth.north, wire.vehicle.truth.east) == (0.0, 0.0)


# -- broken rovers


@dataclass(frozen=True)
class Fault:
    """A way to be broken, and the lines that must say so: no more and no fewer, of these groups."""

    groups: tuple[str, ...]
    lines: frozenset[str]
    says: Callable[[Message], Iterable[Message]] = lambda message: [message]
    hears: Callable[[Message], Message | None] = lambda message: message
    packets: Callable[[], Callable[[bytes], Iterable[bytes]]] = lambda: lambda data: [data]
    persona: Persona = ARDUPILOT
    faults: Faults = Faults()  # noqa: RUF009 - frozen
    options: Options = NOTHING


def without(*kinds: type[Message]) -> Callable[[Message], list[Message]]:
    return lambda message: [] if isinstance(message, kinds) else [message]


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


def every_tenth_lost() -> Callable[[bytes], Iterable[bytes]]:
    numbers = count(1)
    return lambda data: [] if next(numbers) % 10 == 0 else [data]


def acks_from_component_2() -> Callable[[bytes], Iterator[bytes]]:
    decoder, encoder = Decoder(), Encoder(Address(1, 2))

    def change(data: bytes) -> Iterator[bytes]:
        for packet in split_datagram(data):
            message = decoder.decode(packet)
            yield encoder.encode(message) if isinstance(message, m.CommandAck) else data

    return change


def damaged() -> Callable[[bytes], Iterable[bytes]]:
    numbers = count(1)
    return lambda data: [data[:-1] + bytes([data[-1] ^ 1])] if next(numbers) % 5 == 0 else [data]


def takes_commands_of_others(message: Message) -> Message:
    if isinstance(message, m.CommandLong):
        message.target_system = 1
    return message


def streams_each_second_only(message: Message) -> Message:
    if isinstance(message, m.CommandLong) and message.command == SET_MESSAGE_INTERVAL:
        message.param2 = 1e6
    return message


def does_not_disarm(message: Message) -> Message | None:
    off = isinstance(message, m.CommandLong) and (message.command, message.param1) == (400, 0)
    return None if off else message


def no_body_frame(message: Message) -> Message | None:
    return None if isinstance(message, MOTION) and message.coordinate_frame == 8 else message


def a_parameter_missing(message: Message) -> list[Message]:
    lost = isinstance(message, m.ParamValue) and message.param_index == 26
    return [] if lost else [message]


def half_the_heartbeats() -> Callable[[Message], list[Message]]:
    numbers = count()
    return lambda message: (
        [] if isinstance(message, m.Heartbeat) and next(numbers) % 2 else [message]
    )


IDENTITY, TELEMETRY, COMMANDS = ("identity",), ("identity", "telemetry"), ("identity", "commands")
PARAMETERS, PLANS, MODES = ("parameters",), ("identity", "plans"), ("modes",)
FAULTS: dict[str, Fault] = {
    "a copter": Fault(IDENTITY, frozenset({"type"}), says=with_fields(m.Heartbeat, type=2)),
    "half the heartbeats": Fault(
        IDENTITY, frozenset({"heartbeat rate"}), says=half_the_heartbeats()
    ),
    "no COMMAND_INT": Fault(
        IDENTITY,
        frozenset({"COMMAND_INT"}),
        hears=lambda message: None if isinstance(message, m.CommandInt) else message,
    ),
    "no capabilities": Fault(
        IDENTITY, frozenset({"capabilities"}), says=with_fields(m.AutopilotVersion, capabilities=1)
    ),
    "acks dropped": Fault(
        COMMANDS,
        frozenset(
            {
                "AUTOPILOT_VERSION",
                "heartbeat on request",
                "PROTOCOL_VERSION on request",
                "COMPONENT_METADATA on request",
                "COMPONENT_INFORMATION on request",
                "GIMBAL_MANAGER_INFORMATION on request",
                "an unknown message",
                "an unknown command",
                "an unknown COMMAND_INT",
                "ack is addressed to the sender",
                "one ack, from the target",
                "AVAILABLE_MODES",
            }
        ),
        says=without(m.CommandAck),
    ),
    "silence instead of a refusal": Fault(
        COMMANDS,
        frozenset(
            {
                "PROTOCOL_VERSION on request",
                "COMPONENT_METADATA on request",
                "COMPONENT_INFORMATION on request",
                "GIMBAL_MANAGER_INFORMATION on request",
                "an unknown message",
                "an unknown command",
                "an unknown COMMAND_INT",
                "AVAILABLE_MODES",
            }
        ),
        says=no_refusals,
    ),
    "acks to everybody": Fault(
        COMMANDS,
        frozenset({"ack is addressed to the sender"}),
        says=with_fields(m.CommandAck, target_system=0, target_component=0),
    ),
    "acks twice": Fault(COMMANDS, frozenset({"one ack, from the target"}), says=twice),
    "acks from the wrong component": Fault(
        COMMANDS, frozenset({"one ack, from the target"}), packets=acks_from_component_2
    ),
    "obeys what is for others": Fault(
        COMMANDS, frozenset({"a command for another system"}), hears=takes_commands_of_others
    ),
    "no time": Fault(COMMANDS, frozenset({"TIMESYNC"}), says=without(m.Timesync)),
    "no word of files": Fault(
        COMMANDS, frozenset({"MAVLink FTP"}), says=without(m.FileTransferProtocol)
    ),
    "a list of modes with a gap": Fault(
        COMMANDS,
        frozenset({"AVAILABLE_MODES"}),
        says=with_fields(m.AvailableModes, mode_index=lambda index: min(index, 5)),
        persona=PX4,
    ),
    "a message withheld": Fault(
        TELEMETRY, frozenset({"HOME_POSITION"}), faults=Faults(withheld=frozenset({242}))
    ),
    "degrees for radians": Fault(
        TELEMETRY,
        frozenset({"ATTITUDE", "one heading"}),
        says=with_fields(m.Attitude, yaw=math.degrees),
    ),
    "a place of another scale": Fault(
        TELEMETRY,
        frozenset({"one place"}),
        says=with_fields(m.GlobalPositionInt, lat=lambda lat: lat // 10),
    ),
    "boot times in seconds": Fault(
        TELEMETRY,
        frozenset({"boot times"}),
        says=lambda message: with_fields(type(message), time_boot_ms=lambda t: t // 1000)(message)
        if hasattr(message, "time_boot_ms")
        else [message],
    ),
    "one rate for all": Fault(
        ("rates",),
        frozenset({"ATTITUDE at 5 Hz", "ATTITUDE at 20 Hz", "GET_MESSAGE_INTERVAL"}),
        hears=streams_each_second_only,
    ),
    "a parameter that never comes": Fault(
        PARAMETERS, frozenset({"indices"}), says=a_parameter_missing
    ),
    "two counts": Fault(
        PARAMETERS,
        frozenset({"count", "indices"}),
        says=lambda message: with_fields(m.ParamValue, param_count=99)(message)
        if isinstance(message, m.ParamValue) and message.param_index == 5
        else [message],
    ),
    "one name for all parameters": Fault(
        PARAMETERS,
        frozenset(
            {"names", "read by name", "set is echoed"}
            | {"parameters for QGroundControl"}
        ),
        says=lambda message: with_fields(m.ParamValue, _param_id_raw=b"X")(message)
        if isinstance(message, m.ParamValue) and message.param_index > 0
        else [message],
    ),
    "integers in the other encoding": Fault(
        PARAMETERS,
        frozenset({"encoding"}),
        persona=replace(
            ARDUPILOT,
            parameter_protocol=Bytewise(),
            parameters=tuple(
                each if each.type == 9 else replace(each, type=6) for each in ARDUPILOT.parameters
            ),
        ),
    ),
    "a parameter that QGroundControl needs": Fault(
        PARAMETERS,
        frozenset({"parameters for QGroundControl"}),
        persona=replace(
            ARDUPILOT,
            parameters=tuple(e for e in ARDUPILOT.parameters if e.name != "FRAME_CLASS"),
        ),
    ),
    "a plan for somebody else": Fault(
        PLANS,
        frozenset({"mission: download", "fence: download", "rally points: download"}),
        says=with_fields(m.MissionCount, target_system=9),
    ),
    "other items than were uploaded": Fault(
        PLANS,
        frozenset({"mission: comes back"}),
        says=with_fields(m.MissionItemInt, command=lambda number: 17 if number == 16 else number),
        persona=PX4,
        options=Options(write=True),
    ),
    "an upload without an end": Fault(
        PLANS,
        frozenset({f"{kind}: {what}" for kind in ("mission", "fence", "rally points")
                   for what in ("upload", "clear", "restore")}),
        says=without(m.MissionAck),
        persona=PX4,
        options=Options(write=True),
    ),
    "a mode that is not shown": Fault(
        MODES,
        frozenset({"enter HOLD", "enter the control mode", "SET_MODE message"}),
        says=with_fields(m.Heartbeat, custom_mode=0),
    ),
    "modes refused": Fault(
        MODES,
        frozenset({"enter HOLD", "enter the control mode", "SET_MODE message"}),
        faults=Faults(refuse_mode=True),
    ),
    "arming refused": Fault(
        ("arming",),
        frozenset({"arm"}),
        faults=Faults(refuse_arm=True),
        options=Options(arm=True),
    ),
    "no disarming": Fault(
        ("arming", "driving"),
        frozenset({"disarm"}),
        hears=does_not_disarm,
        options=Options(arm=True),
    ),
    "no frame of its own": Fault(
        ("driving",),
        frozenset({"velocity in BODY_NED", "yaw rate in BODY_NED", "backwards in BODY_NED"}),
        hears=no_body_frame,
        options=ALL,
    ),
    "centimetres for metres": Fault(
        ("driving",),
        frozenset({"one way"}),
        says=with_fields(m.GlobalPositionInt, vx=lambda v: v // 100, vy=lambda v: v // 100),
        options=ALL,
    ),
    "setpoints that last for ever": Fault(
        ("driving",),
        frozenset({"setpoints stop"}),
        persona=replace(
            PX4,
            parameters=tuple(
                replace(each, value=60.0) if each.name == "COM_OF_LOSS_T" else each
                for each in PX4.parameters
            ),
        ),
        options=ALL,
    ),
    "packets lost": Fault(
        ("identity", "packets"), frozenset({"sequence numbers"}), packets=every_tenth_lost
    ),
    "packets damaged": Fault(
        ("identity", "packets"),
        frozenset({"heartbeat rate", "sequence numbers", "whole packets"}),
        packets=damaged,
    ),
}  # fmt: skip


def test_what_is_wrong_is_named_and_nothing_else() -> None:
    for name in FAULTS:
        fault = FAULTS[name]
        wire = VirtualWire(
            fault.persona, says=fault.says, hears=fault.hears, packets=fault.packets()
        )
        wire.vehicle.autopilot.set_faults(fault.faults)
        report = run(wire, fault.options, fault.groups)
        assert {line.name for line in report.failed} == fault.lines
        for line in report.failed:
            assert "expected" in line.said
            assert "seen" in line.said


def test_a_rover_that_cannot_be_disarmed_is_left_in_hold_and_said_so() -> None:
    wire = VirtualWire(ARDUPILOT, hears=does_not_disarm)
    report = run(wire, ALL, ("driving",))
    assert {"left behind", "disarm while driving"} <= {line.name for line in report.failed}
    assert wire.vehicle.autopilot.mode is Mode.HOLD
    assert abs(wire.vehicle.truth.forward_speed) < 0.05


# -- whatever happens while it drives


def while_driving(do: Callable[[VirtualWire], None]) -> Callable[[VirtualWire], None]:
    done: list[bool] = []

    def at(wire: VirtualWire) -> None:
        if not done and wire.vehicle.truth.forward_speed > 0.4:
            done.append(True)
            do(wire)

    return at


def interrupt(_wire: VirtualWire) -> None:
    raise KeyboardInterrupt


def break_down(_wire: VirtualWire) -> None:
    raise RuntimeError("a fault of our own")


def test_it_ends_with_zeros_hold_and_disarmed() -> None:
    for name in PERSONAS:
        for accident, error in [(interrupt, KeyboardInterrupt), (break_down, RuntimeError)]:
            wire = VirtualWire(PERSONAS[name], at=while_driving(accident))
            with pytest.raises(error):
                run(wire, ALL, ("driving",))
            last = wire.setpoints[-1]
            assert (last.vx, last.vy, last.yaw_rate) == (0.0, 0.0, 0.0)
            assert wire.vehicle.autopilot.mode is Mode.HOLD
            assert not wire.vehicle.autopilot.armed


def test_a_rover_that_somebody_else_takes_gets_no_other_motion() -> None:
    for name in PERSONAS:
        taken: list[int] = []

        def take(wire: VirtualWire) -> None:
            wire.vehicle.autopilot.operator_mode(Mode.MANUAL, now=wire.now())
            taken.append(len(wire.setpoints))

        wire = VirtualWire(PERSONAS[name], at=while_driving(take))
        report = run(wire, ALL, ("driving",))
        (line,) = report.failed
        assert "it left the control mode" in line.said
        late = [each for each in wire.setpoints[taken[0] :] if (each.vx, each.vy) != (0.0, 0.0)]
        assert len(late) <= 21  # those of the second until the next heartbeat


def test_it_does_not_drive_blind() -> None:
    for kind, named in [(m.Heartbeat, "no heartbeat"), (m.LocalPositionNed, "no LOCAL_POSITION")]:

        def lose(wire: VirtualWire) -> None:
            wire.vehicle.autopilot.set_faults(Faults(withheld=frozenset({kind.id})))

        wire = VirtualWire(ARDUPILOT, at=while_driving(lose))
        report = run(wire, ALL, ("driving",))
        assert any(named in line.said for line in report.failed)
        assert wire.vehicle.autopilot.mode is Mode.HOLD
        assert not wire.vehicle.autopilot.armed


def test_no_motion_is_asked_of_a_rover_that_is_armed_by_somebody_else() -> None:
    wire = VirtualWire(ARDUPILOT)
    wire.vehicle.autopilot.operator_arm(True, now=wire.now())
    report = run(wire, ALL, ("modes", "arming", "driving"))
    assert {line.outcome for line in report.lines} == {Outcome.SKIPPED}
    assert wire.setpoints == []
    assert wire.vehicle.autopilot.armed


# -- what genuine ones do, and what is no fault


def tells_of_a_change(name: str, kind: int) -> Callable[[Message], list[Message]]:
    """A PARAM_VALUE without an index, as a genuine one sends unasked, before each of the list."""

    def change(message: Message) -> list[Message]:
        if not isinstance(message, m.ParamValue) or message.param_index == 65535:
            return [message]
        unasked = m.ParamValue(name.encode(), 0.0, kind, message.param_count, 65535)
        return [unasked, message]

    return change


GENUINE = {
    "an ArduPilot's landed_state": (ARDUPILOT, with_fields(m.ExtendedSysState, landed_state=0)),
    "an ArduPilot that tells of a parameter": (ARDUPILOT, tells_of_a_change("STAT_RUNTIME", 6)),
    "a PX4's airspeed, of which it has none": (PX4, with_fields(m.VfrHud, airspeed=math.nan)),
    "a PX4's _HASH_CHECK in its list": (PX4, tells_of_a_change("_HASH_CHECK", 5)),
}


def test_what_genuine_ones_do_is_no_fault() -> None:
    for what in GENUINE:
        persona, says = GENUINE[what]
        report = run(VirtualWire(persona, says=says), NOTHING)
        assert [str(line) for line in report.failed] == []
