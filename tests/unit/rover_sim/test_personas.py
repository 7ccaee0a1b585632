"""What each make answers: one table of (persona, message, answer)."""

import math
from struct import pack, unpack
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavResult
from mav_tasks.mavlink.messages import Message
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import PERSONAS
from tests.unit.rover_sim.rig import Rig

A, P, G = "ardupilot", "px4", "generic"
NAN = math.nan
X, Y = DEFAULT_ORIGIN.to_global(4.0, 2.0)
NO_PLACE = 0x7FFFFFFF
BYTEWISE_50000 = unpack("<f", pack("<i", 50000))[0]  # an integer's bytes in the float


def long(command: int, *params: float, component: int = 1) -> m.CommandLong:
    padded = (*params, *(0.0,) * (7 - len(params)))
    return m.CommandLong(1, component, command, 0, *padded)


def reposition(flags: float = 1.0, *, x: int = X, y: int = Y, frame: int = 0) -> m.CommandInt:
    return m.CommandInt(1, 1, frame, MavCmd.DO_REPOSITION, 0, 0, -1.0, flags, 0.0, NAN, x, y, 0.0)


def ack(command: int, result: MavResult) -> list[dict[str, Any]]:
    return [{"mavpackettype": "COMMAND_ACK", "command": command, "result": result}]


def mission_ack(result: MavMissionResult) -> list[dict[str, Any]]:
    return [{"mavpackettype": "MISSION_ACK", "type": result}]


ACCEPTED, FAILED, DENIED = MavResult.ACCEPTED, MavResult.FAILED, MavResult.DENIED
REJECTED, UNSUPPORTED = MavResult.TEMPORARILY_REJECTED, MavResult.UNSUPPORTED
MODE, ARM, GO = MavCmd.DO_SET_MODE, MavCmd.COMPONENT_ARM_DISARM, MavCmd.DO_REPOSITION
SILENCE: list[dict[str, Any]] = []
BEAT = {"mavpackettype": "HEARTBEAT"}

TABLE: list[tuple[str, Message, list[dict[str, Any]]]] = [
    # modes: ArduPilot's number in param2; PX4's main mode in param2, sub mode in param3
    (A, long(MODE, 1, 4), ack(MODE, ACCEPTED)),
    (P, long(MODE, 1, 4, 3), ack(MODE, ACCEPTED)),
    (P, long(MODE, 1, 4, 4), ack(MODE, ACCEPTED)),  # any mode, while it is disarmed
    (P, long(262, 5), ack(262, ACCEPTED)),  # DO_SET_STANDARD_MODE: safe recovery
    (A, long(MODE, 1, 99), ack(MODE, FAILED)),
    # the old message: the whole number for all; PX4 answers as to the command
    (A, m.SetMode(1, 1, 4), ack(11, ACCEPTED)),
    (P, m.SetMode(1, 1, 0x03040000), ack(MODE, ACCEPTED)),
    # arming
    (P, long(ARM, 1), ack(ARM, ACCEPTED)),
    # going somewhere
    (A, reposition(), ack(GO, ACCEPTED)),
    (A, long(GO, -1, 1, 0, NAN, NAN, NAN, NAN), ack(GO, UNSUPPORTED)),
    (P, reposition(), ack(GO, ACCEPTED)),
    (P, reposition(x=NO_PLACE, y=NO_PLACE), ack(GO, ACCEPTED)),
    (P, reposition(0.0), ack(GO, UNSUPPORTED)),  # only with the mode change
    (P, long(MavCmd.NAV_RETURN_TO_LAUNCH), ack(MavCmd.NAV_RETURN_TO_LAUNCH, ACCEPTED)),
    (P, long(MavCmd.DO_CHANGE_SPEED, 1, 2.0), ack(MavCmd.DO_CHANGE_SPEED, ACCEPTED)),
    (A, long(MavCmd.MISSION_START), ack(MavCmd.MISSION_START, ACCEPTED)),  # its own square
    (P, long(MavCmd.MISSION_START), ack(MavCmd.MISSION_START, DENIED)),
    # whatever else
    (P, long(31010), ack(31010, UNSUPPORTED)),
    (P, long(512, 436), [{"custom_mode": 0x03040000, "standard_mode": 0}, *ack(512, ACCEPTED)]),
    (A, long(512, 0), [BEAT, *ack(512, ACCEPTED)]),
    (P, long(512, 0), [BEAT, *ack(512, ACCEPTED)]),
    (P, long(31010, component=50), SILENCE),
    # plans
    (A, m.MissionCount(1, 1, 1), [{"mavpackettype": "MISSION_REQUEST", "seq": 0}]),
    (P, m.MissionCount(1, 1, 1), [{"mavpackettype": "MISSION_REQUEST_INT", "seq": 0}]),
    (P, m.MissionCount(1, 1, 3000), mission_ack(MavMissionResult.NO_SPACE)),
    # parameters
    (P, m.ParamRequestRead(1, 1, b"NO_SUCH", -1), SILENCE),
    (P, m.ParamRequestRead(1, 1, b"SYS_AUTOSTART", -1), [{"param_value": BYTEWISE_50000}]),
    (P, m.ParamSet(1, 1, b"SYS_AUTOSTART", BYTEWISE_50000, 6), [{"param_value": BYTEWISE_50000}]),
    (P, m.ParamSet(1, 1, b"COM_OF_LOSS_T", 1.0, 6), SILENCE),  # of another type
]
#: a generic one speaks as PX4 does
TABLE += [(G, message, answer) for name, message, answer in TABLE if name == P]


def test_what_it_answers() -> None:
    for name, message, answer in TABLE:
        rig = Rig(PERSONAS[name])
        rig.heard.clear()
        rig.send(message)
        unasked = [m.Statustext] if BEAT in answer else [m.Statustext, m.Heartbeat]  # new mode
        heard = [each.to_dict() for each in rig.heard if type(each) not in unasked]
        wanted = [
            {key: found[key] for key in each} for each, found in zip(answer, heard, strict=True)
        ]
        assert wanted == answer


def test_each_persona_shows_itself() -> None:
    shown = {}
    for name, persona in PERSONAS.items():
        rig = Rig(persona)
        beat = rig.last(m.Heartbeat)
        shown[name] = (beat.autopilot, beat.type, hex(beat.custom_mode), beat.base_mode & 129)
    assert shown == {
        A: (3, 10, "0x0", 1),
        P: (12, 10, "0x3040000", 1),
        G: (0, 10, "0x3040000", 1),
    }


def test_unusable_numbers_in_commands_arm_nothing() -> None:
    for name in PERSONAS:
        for value in [NAN, math.inf, -math.inf, -1e30, 1e30]:
            rig = Rig(PERSONAS[name])
            for command in (*MavCmd, 224):
                if (name, command) != (A, MavCmd.DO_CHANGE_SPEED):  # which makes ArduPilot abort
                    rig.send(long(command, *[value] * 7))
            assert not rig.autopilot.armed
