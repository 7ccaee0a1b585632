"""Each command becomes its task, or a refusal that names the parameter."""

from collections.abc import Callable
from math import inf, nan, pi, radians

from mav_tasks.tasks.events import SubmissionRefused
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
from mav_tasks.tasks.lifecycle import TaskReason as R
from tests.kit.client import DENIED, DRIVE, MOVE, ROTATE, FakeClient, Sent
from tests.kit.world import World, at

WAYPOINT, LOITER, RETURN, DELAY, YAW, REPOSITION, HEAD = 16, 19, 20, 93, 115, 192, 213
XY = at(3.0, 4.0)
PLACE = GlobalPlace(*XY.values())
GLOBAL = 6
NOWHERE = 2**31 - 1

Ask = Callable[[FakeClient], Sent]


def long(command: int, *params: float) -> Ask:
    return lambda client: client.command(command, *params)


def whole(command: int, *params: float, frame: int = GLOBAL, **place: float) -> Ask:
    return lambda client: client.command_int(command, *params, frame=frame, **place)  # type: ignore[arg-type]


GOALS: tuple[tuple[Ask, Goal], ...] = (
    (long(MOVE, -2.5, 0.75), Move(-2.5, 0.75)),
    (long(MOVE, 2.0, nan, nan, nan, nan, nan, nan), Move(2.0)),
    (whole(MOVE, 3.0, nan, 0, 77, frame=8), Move(3.0)),
    (long(ROTATE, -450, 20), Rotate(radians(-450), radians(20))),
    (long(DRIVE, -0.5, 20, 3), Drive(-0.5, radians(20), 3.0)),
    (whole(WAYPOINT, **XY), GoTo(PLACE)),
    (whole(WAYPOINT, 2, 0.5, 0, 90, **XY), GoTo(PLACE, None, 0.5, pi / 2, 2)),
    (whole(WAYPOINT, x=-15_000, y=20_000, frame=1), GoTo(LocalPlace(-1.5, 2.0))),
    (whole(REPOSITION, -1, 1, 0, 1.5, **XY), GoTo(PLACE, yaw=1.5)),
    (whole(REPOSITION, 1.5, 1, -9, nan, **XY), GoTo(PLACE, 1.5)),
    (long(RETURN), GoTo(None)),
    (long(DELAY, 4.5), Wait(4.5)),
    (long(DELAY, -1, 14, 5), Wait(86_400.0, (14, 5, 0))),
    (long(LOITER, 3), Wait(3.0)),
    (whole(LOITER, 3, **XY), GoTo(PLACE, wait=3.0)),
    (long(YAW, 90, 20, -1, 0), Face(pi / 2, -1, radians(20))),
    (long(YAW, 90, 0, -1, 1), Rotate(-pi / 2)),
    (long(HEAD, -90, 0.5, 1), Head(-pi / 2, 0.5, 3.0, is_relative=True)),
)
REFUSED: tuple[tuple[Ask, str], ...] = (
    (long(MOVE, nan), "param1 distance is not given"),
    (long(MOVE, 0.0), "param1 distance is 0: nothing to do"),
    (long(MOVE, -10_001), "param1 distance -10001 not in -10000..10000"),
    (long(MOVE, 1.0, -0.1), "param2 speed -0.1 not in 0.01..2"),
    (long(MOVE, 1.0, inf), "param2 speed inf not in 0.01..2"),
    (long(MOVE, 1.0, 0, 1), "param3 (unused): must be 0"),
    (long(MOVE, 1.0, 0, 0, 0.5), "param4 nonce 0.5 is not a whole number"),
    (long(MOVE, 1.0, 0, 0, 0, -7), "param5 run after -7 not in 0.."),
    (long(MOVE, 1.0, 0, 0, 0, 0, inf), "param6 start delay inf not in 0.."),
    (long(MOVE, 1.0, 0, 0, 0, 0, 0, 11), "param7 priority 11 not in 0..10"),
    (long(ROTATE, 3601), "param1 angle 3601 not in -3600..3600"),
    (long(ROTATE, 90, 91), "param2 rate 91 not in 0.1..90"),
    (long(DRIVE, 3, 0, 1), "param1 forward speed 3 not in -2..2"),
    (long(DRIVE, 0, 0, 1), "param1 speed and param2 rate are 0"),
    (long(DRIVE, 1, 0, 0), "param3 duration is 0"),
    (whole(WAYPOINT, x=900_000_001, y=5), "x latitude 90.0000001 not in -90..90"),
    (whole(WAYPOINT, x=5, y=-1_800_000_001), "y longitude -180.0000001 not in -180..180"),
    (whole(WAYPOINT), "latitude and longitude are 0"),
    (whole(WAYPOINT, x=NOWHERE, y=NOWHERE), "param5 latitude, param6 longitude"),
    (long(REPOSITION, -1, 0, 0, nan, 91, 8), "param5 latitude 91 not in -90..90"),
    (long(REPOSITION, -1, 0, 0, nan, nan, 8), "param5 latitude is not given"),
    (whole(REPOSITION, -1, 0, 0, 90, x=5, y=5), "param4 yaw 90 not in -6.28"),
    (whole(REPOSITION, -1, 3, 0, 1, x=5, y=5), "param2 relative yaw is not supported"),
    (long(REPOSITION, -1, 0, -inf, nan, 47, 8), "param3 is infinite"),
    (long(RETURN, 0, inf), "param2 is infinite"),
    (long(DELAY, -1, 24), "param2 hour 24 not in -1..23"),
    (long(YAW, 90, 0, 2), "param3 direction 2 not in -1..1"),
    (long(HEAD, 90, nan), "param2 speed is not given"),
    (whole(MOVE, 2.0, frame=99), "frame 99 is unknown"),
)


def test_each_command_has_its_goal_and_what_goes_with_it(world: World) -> None:
    world.client.pause()
    world.run(0.5)
    for ask, goal in GOALS:
        sent = ask(world.client)
        world.run(0.3)
        assert world.task(sent.task_id).goal == goal
    sent = world.client.command(MOVE, 1.0, 0, 0, 78, 9, 2.5, 8)
    world.run(0.3)
    task = world.task(sent.task_id)
    assert (task.priority, task.terms.after, task.marks.nonce) == (8, 9, 78)
    assert task.terms.start_at is not None
    assert 0 <= task.terms.start_at - sent.at - 2.5 < 0.1


def test_a_number_that_is_of_no_use_is_refused_by_its_name(world: World) -> None:
    for ask, text in REFUSED:
        sent = ask(world.client)
        world.run(0.3)
        reason = R.BAD_FRAME if text.startswith("frame") else R.BAD_PARAMETER
        assert sent.answer == (DENIED, reason), text
        refusal = world.events(SubmissionRefused)[-1]
        assert (refusal.reason, refusal.text[: len(text)]) == (reason, text)
    assert world.tasks() == ()
