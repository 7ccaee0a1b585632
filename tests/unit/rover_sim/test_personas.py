"""What each make answers: one table of (persona, message, answer)."""

import math
from struct import pack, unpack
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.geo import DEFAULT_ORIGIN
from rover_sim.personas import PERSONAS
from tests.unit.rover_sim.rig import Rig

A, P, G = "ardupilot", "px4", "generic"
NAN = math.nan
X, Y = DEFAULT_ORIGIN.to_global(4.0, 2.0)
BYTEWISE_50000 = unpack("<f", pack("<i", 50000))[0]  # an integer's bytes in the float


def long(command: int, *params: float) -> m.CommandLong:
    padded = (*params, *(0.0,) * (7 - len(params)))
    return m.CommandLong(1, 1, command, 0, *padded)


#: make, message and answers: the result of its command, or a message with fields; GO is an order to
#: a place, a number alone a command
TABLE = """
# modes: ArduPilot's number in param2; PX4's main mode in param2, sub mode in param3
ardupilot DO_SET_MODE 1 4: ACCEPTED
px4 DO_SET_MODE 1 4 3: ACCEPTED
px4 DO_SET_MODE 1 4 4: ACCEPTED  # any mode, while it is disarmed
px4 262 5: ACCEPTED  # DO_SET_STANDARD_MODE: safe recovery
ardupilot DO_SET_MODE 1 99: FAILED
# the old message: the whole number for all; PX4 answers as to the command
ardupilot SetMode 1 1 4: COMMAND_ACK command=11 result=0
px4 SetMode 1 1 0x03040000: COMMAND_ACK command=176 result=0
# arming
px4 COMPONENT_ARM_DISARM 1: ACCEPTED
# going somewhere
ardupilot GO 1 0 nan X Y 0: ACCEPTED
ardupilot DO_REPOSITION -1 1 0 nan nan nan nan: UNSUPPORTED
px4 GO 1 0 nan X Y 0: ACCEPTED
px4 GO 1 0 nan 0x7FFFFFFF 0x7FFFFFFF 0: ACCEPTED
px4 GO 0 0 nan X Y 0: UNSUPPORTED  # only with the mode change
px4 NAV_RETURN_TO_LAUNCH: ACCEPTED
px4 DO_CHANGE_SPEED 1 2: ACCEPTED
ardupilot MISSION_START: ACCEPTED  # its own square
px4 MISSION_START: DENIED
# whatever else
px4 31010: UNSUPPORTED
px4 512 436: CURRENT_MODE custom_mode=0x03040000 standard_mode=0 & ACCEPTED
ardupilot 512 0: HEARTBEAT & ACCEPTED
px4 512 0: HEARTBEAT & ACCEPTED
px4 CommandLong 1 50 31010 0 0 0 0 0 0 0 0:
# plans; 4: no space
ardupilot MissionCount 1 1 1: MISSION_REQUEST seq=0
px4 MissionCount 1 1 1: MISSION_REQUEST_INT seq=0
px4 MissionCount 1 1 3000: MISSION_ACK type=4
# parameters; BYTEWISE is 50000
px4 ParamRequestRead 1 1 NO_SUCH -1:
px4 ParamRequestRead 1 1 SYS_AUTOSTART -1: PARAM_VALUE param_value=BYTEWISE
px4 ParamSet 1 1 SYS_AUTOSTART BYTEWISE 6: PARAM_VALUE param_value=BYTEWISE
px4 ParamSet 1 1 COM_OF_LOSS_T 1.0 6:  # of another type
"""
PLACES = {"X": X, "Y": Y, "BYTEWISE": BYTEWISE_50000}
GO = "CommandInt 1 1 0 192 0 0 -1"


def value(word: str) -> Any:
    if word[0].isupper():
        return PLACES.get(word, word.encode())
    return float(word) if "." in word or word == "nan" else int(word, 0)


def message_of(text: str) -> Any:
    name, *words = text.replace("GO", GO).split()
    numbers = [value(word) for word in words]
    if name.isupper() or name.isdigit():
        return long(int(name) if name.isdigit() else MavCmd[name], *numbers)
    return getattr(m, name)(*numbers)


def check(make: str, request: str, answer: str) -> None:
    rig, message = Rig(PERSONAS[make]), message_of(request)
    rig.heard.clear()
    rig.send(message)
    unasked = [m.Statustext] if "HEARTBEAT" in answer else [m.Statustext, m.Heartbeat]  # new mode
    heard = [each.to_dict() for each in rig.heard if type(each) not in unasked]
    wanted = answer.split(" & ") if answer else []
    for found, text in zip(heard, wanted, strict=True):
        name, *fields = text.split()
        expected = {key: value(word) for key, _, word in (each.partition("=") for each in fields)}
        if name in MavResult.__members__:
            name, expected = "COMMAND_ACK", {"command": message.command, "result": MavResult[name]}
        assert found["mavpackettype"] == name, (request, found)
        assert found.items() >= expected.items(), request


def test_what_it_answers() -> None:
    for row in TABLE.strip().splitlines():
        make, _, rest = row.split("#")[0].partition(" ")
        if make:
            request, _, answer = rest.partition(":")
            check(make, request, answer.strip())
            if make == "px4":
                check("generic", request, answer.strip())  # it speaks as PX4 does


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
