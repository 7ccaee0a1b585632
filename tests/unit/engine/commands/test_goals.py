"""Commands become goals, or a refusal that names the parameter."""

from math import inf, nan, pi, radians

import pytest

from mav_tasks.engine.commands.goals import GOALS, ParsedCommand, marks_of, parse_command
from mav_tasks.engine.policy import is_task_command
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.messages import CommandInt, CommandLong
from mav_tasks.services.command_receiver import Command, command_of
from mav_tasks.settings import Driving
from mav_tasks.tasks.goal import (
    Drive,
    Face,
    GlobalPlace,
    Goal,
    GoTo,
    Head,
    LocalPlace,
    Move,
    Rotate,
    Wait,
)
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Terms

R, C = TaskReason, MavCmd
DRIVING = Driving()
NOW = 100.0
PLACE = GlobalPlace(473_977_418, 85_455_938)
XY = (473_977_418, 85_455_938)


def command(number: int, *params: float) -> Command:
    filled = (*params, *(0.0,) * (6 - len(params)), 5.0)[:7]
    return command_of(CommandLong(1, 191, number, 0, *filled))


def whole(number: int, *params: float, x: int = 0, y: int = 0, frame: int = 6) -> Command:
    one, two, three, four = (*params, *(0.0,) * (4 - len(params)))
    message = CommandInt(1, 191, frame, number, 0, 0, one, two, three, four, x, y, 0.0)
    if is_task_command(number):
        message.z = 5.0  # the priority
    return command_of(message)


def move(*params: float) -> Command:
    return command(C.TASK_MOVE, *params)


def rotate(*params: float) -> Command:
    return command(C.TASK_ROTATE, *params)


def wished(what: Command) -> ParsedCommand:
    return parse_command(what, b"packet", DRIVING, now=NOW)


def refused(what: Command) -> tuple[int, str]:
    with pytest.raises(Rejection) as refusal:
        wished(what)
    return refusal.value.reason, refusal.value.text


def test_a_move_with_all_that_goes_with_it() -> None:
    wish = wished(move(-2.5, 0.75, 0, 77, 9, 2.5, 8))
    assert wish.goal == Move(-2.5, 0.75)
    assert wish.terms == Terms(priority=8, after=9, start_at=NOW + 2.5)
    assert wish.marks.nonce == 77


def test_a_command_int_carries_the_same() -> None:
    wish = wished(whole(C.TASK_MOVE, 2.0, nan, 0, 77, x=9, y=3, frame=8))
    assert (wish.goal, wish.terms.after, wish.terms.start_at) == (Move(2.0), 9, NOW + 3)


def test_nan_is_not_given_wherever_there_is_a_default() -> None:
    wish = wished(move(2.0, nan, nan, nan, nan, nan, nan))
    assert (wish.goal, wish.terms, wish.marks.nonce) == (Move(2.0), Terms(), 0)


@pytest.mark.parametrize(
    ("what", "goal"),
    [
        (rotate(-450, 20), Rotate(radians(-450), radians(20))),
        (command(C.TASK_DRIVE, -0.5, 20, 3), Drive(-0.5, radians(20), 3.0)),
        (whole(C.NAV_WAYPOINT, x=XY[0], y=XY[1]), GoTo(PLACE)),
        (whole(C.NAV_WAYPOINT, 2, 0.5, 0, 90, x=XY[0], y=XY[1]), GoTo(PLACE, None, 0.5, pi / 2, 2)),
        (whole(C.NAV_WAYPOINT, x=-15_000, y=20_000, frame=1), GoTo(LocalPlace(-1.5, 2.0))),
        (whole(C.DO_REPOSITION, -1, 1, 0, nan, x=XY[0], y=XY[1]), GoTo(PLACE)),
        (whole(C.DO_REPOSITION, -1, 1, 0, pi / 2, x=XY[0], y=XY[1]), GoTo(PLACE, yaw=pi / 2)),
        (whole(C.DO_REPOSITION, -1, nan, 0, 0, x=XY[0], y=XY[1]), GoTo(PLACE)),
        (whole(C.DO_REPOSITION, 1.5, 1, -9, nan, x=XY[0], y=XY[1]), GoTo(PLACE, 1.5)),
        (command(C.NAV_RETURN_TO_LAUNCH), GoTo(None)),
        (command(C.NAV_DELAY, 4.5), Wait(4.5)),
        (command(C.NAV_DELAY, 0), Wait(0.0)),
        (command(C.NAV_DELAY, -1, 14, 5), Wait(86_400.0, (14, 5, 0))),
        (command(C.NAV_DELAY, 0, -1, 30, -1), Wait(3_600.0, (-1, 30, -1))),
        (command(C.NAV_LOITER_TIME, 3), Wait(3.0)),
        (whole(C.NAV_LOITER_TIME, 3, x=XY[0], y=XY[1]), GoTo(PLACE, wait=3.0)),
        (command(C.CONDITION_YAW, 90, 20, -1, 0), Face(pi / 2, -1, radians(20))),
        (command(C.CONDITION_YAW, 90, 0, -1, 1), Rotate(-pi / 2)),
        (command(C.NAV_SET_YAW_SPEED, -90, 0.5, 1), Head(-pi / 2, 0.5, 3.0, is_relative=True)),
    ],
)
def test_each_command_has_its_goal(what: Command, goal: Goal) -> None:
    assert wished(what).goal == goal


def test_degrees_in_floats_are_as_exact_as_floats_are() -> None:
    place = wished(command(C.DO_REPOSITION, -1, 0, 0, nan, 47.25, -8.5)).goal
    assert place == GoTo(GlobalPlace(472_500_000, -85_000_000))


def test_every_command_that_becomes_a_task_is_tried_here() -> None:
    assert len(GOALS) == 10


@pytest.mark.parametrize(
    ("what", "text"),
    [
        (move(nan), "param1 distance is not given"),
        (move(0.0), "param1 distance is 0: nothing to do"),
        (move(inf), "param1 distance inf not in -10000..10000"),
        (move(-10_001), "param1 distance -10001 not in -10000..10000"),
        (move(1.0, -0.1), "param2 speed -0.1 not in 0.01..2"),
        (move(1.0, 2.5), "param2 speed 2.5 not in 0.01..2"),
        (move(1.0, inf), "param2 speed inf not in 0.01..2"),
        (move(1.0, 0, 1), "param3 (unused): must be 0"),
        (move(1.0, 0, 0, -1), "param4 nonce -1 not in 0.."),
        (move(1.0, 0, 0, 0.5), "param4 nonce 0.5 is not a whole number"),
        (move(1.0, 0, 0, 0, -7), "param5 run after -7 not in 0.."),
        (move(1.0, 0, 0, 0, 0, -3), "param6 start delay -3 not in 0.."),
        (move(1.0, 0, 0, 0, 0, inf), "param6 start delay inf not in 0.."),
        (move(1.0, 0, 0, 0, 0, 0, 11), "param7 priority 11 not in 0..10"),
        (move(1.0, 0, 0, 0, 0, 0, 2.5), "param7 priority 2.5 is not a whole number"),
        (move(1.0, 0, 0, 0, 0, 0, -inf), "param7 priority -inf not in 0..10"),
        (rotate(nan), "param1 angle is not given"),
        (rotate(0.0), "param1 angle is 0: nothing to do"),
        (rotate(3601), "param1 angle 3601 not in -3600..3600"),
        (rotate(90, 91), "param2 rate 91 not in 0.1..90"),
        (command(C.TASK_DRIVE, 3, 0, 1), "param1 forward speed 3 not in -2..2"),
        (command(C.TASK_DRIVE, 0, 0, 1), "param1 speed and param2 rate are 0"),
        (command(C.TASK_DRIVE, 1, 0, 0), "param3 duration is 0"),
        (command(C.TASK_DRIVE, 1, 0, nan), "param3 duration is not given"),
        (whole(C.NAV_WAYPOINT, x=900_000_001, y=5), "x latitude 90.0000001 not in -90..90"),
        (whole(C.NAV_WAYPOINT, x=5, y=-1_800_000_001), "y longitude -180.0000001 not in -180..180"),
        (whole(C.NAV_WAYPOINT), "latitude and longitude are 0"),
        (whole(C.NAV_WAYPOINT, x=2**31 - 1, y=2**31 - 1), "param5 latitude, param6 longitude"),
        (command(C.DO_REPOSITION, -1, 0, 0, nan, 91, 8), "param5 latitude 91 not in -90..90"),
        (command(C.DO_REPOSITION, -1, 0, 0, nan, nan, 8), "param5 latitude is not given"),
        (command(C.DO_REPOSITION, -1, 0, 0, inf, 47, 8), "param4 yaw inf not in"),
        (whole(C.DO_REPOSITION, -1, 0, 0, 90, x=5, y=5), "param4 yaw 90 not in -6.28"),
        (whole(C.DO_REPOSITION, -1, 3, 0, 1, x=5, y=5), "param2 relative yaw is not supported"),
        (command(C.DO_REPOSITION, -1, 0, 0, nan, 47, 8, inf), "param7 is infinite"),
        (command(C.DO_REPOSITION, -1, 0, -inf, nan, 47, 8), "param3 is infinite"),
        (command(C.NAV_RETURN_TO_LAUNCH, 0, inf), "param2 is infinite"),
        (command(C.NAV_DELAY, -1, 24), "param2 hour 24 not in -1..23"),
        (command(C.NAV_DELAY, nan), "param1 delay is not given"),
        (command(C.CONDITION_YAW, 90, 0, 2), "param3 direction 2 not in -1..1"),
        (command(C.CONDITION_YAW, 90, 0, 0, 2), "param4 relative 2 not in 0..1"),
        (command(C.NAV_SET_YAW_SPEED, 90, nan), "param2 speed is not given"),
    ],
)
def test_a_number_that_is_of_no_use_is_refused_by_its_name(what: Command, text: str) -> None:
    reason, words = refused(what)
    assert (reason, words[: len(text)]) == (R.BAD_PARAMETER, text)


def test_a_frame_that_nobody_knows_or_that_means_no_place_is_refused() -> None:
    assert refused(whole(C.TASK_MOVE, 2.0, frame=99)) == (R.BAD_FRAME, "frame 99 is unknown")
    assert refused(whole(C.NAV_WAYPOINT, x=1, y=1, frame=8))[0] == R.BAD_FRAME


class TestMarks:
    def test_equal_commands_are_equal_and_any_nan_is_equal_to_nan(self) -> None:
        one, other = move(1, nan, 0, 0, 0, 0, nan), move(1, -nan, 0, 0, 0, 0, nan)
        assert marks_of(one, b"a").payload == marks_of(other, b"b").payload

    def test_whatever_differs_makes_another(self) -> None:
        others = [
            move(1),
            move(2),
            move(1, nan),
            move(1, 1),
            rotate(1),
            whole(C.TASK_MOVE, 1, frame=0),
            command_of(CommandLong(1, 1, C.TASK_MOVE, 0, 1, 0, 0, 0, 0, 0, 5)),
            command_of(CommandLong(2, 191, C.TASK_MOVE, 0, 1, 0, 0, 0, 0, 0, 5)),
        ]
        assert len({marks_of(each, b"").payload for each in others}) == len(others)

    def test_the_packet_counts_only_without_a_nonce(self) -> None:
        assert marks_of(move(1), b"a").packet != marks_of(move(1), b"b").packet
        assert marks_of(move(1), b"a", nonce=7).packet == ""
