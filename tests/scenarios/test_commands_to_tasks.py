"""Each command becomes its task, or a refusal that names the parameter."""

from collections.abc import Callable
from math import nan, pi, radians

from mav_tasks.kinds import Drive, Face, GlobalPlace, GoTo, Head, LocalPlace, Move, Rotate, Wait
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.goal import Goal
from mav_tasks.tasks.lifecycle import TaskReason as R
from tests.kit.client import DRIVE, MOVE, ROTATE, FakeClient, Sent
from tests.kit.rows import check
from tests.kit.world import World, at

WAYPOINT, LOITER, RETURN, DELAY, YAW, REPOSITION, HEAD = 16, 19, 20, 93, 115, 192, 213
XY = at(3.0, 4.0)
PLACE = GlobalPlace(*XY.values())
GLOBAL = 6

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
REFUSED = """
TASK_MOVE nan : DENIED param1 distance is not given
TASK_MOVE 0 : DENIED param1 distance is 0: nothing to do
TASK_MOVE -10001 : DENIED param1 distance -10001 not in -10000..10000
TASK_MOVE 1 -0.1 : DENIED param2 speed -0.1 not in 0.01..2
TASK_MOVE 1 inf : DENIED param2 speed inf not in 0.01..2
TASK_MOVE 1 0 1 : DENIED param3 (unused): must be 0
TASK_MOVE 1 0 0 0.5 : DENIED param4 nonce 0.5 is not a whole number
TASK_MOVE 1 0 0 0 -7 : DENIED param5 run after -7 not in 0..
TASK_MOVE 1 0 0 0 0 inf : DENIED param6 start delay inf not in 0..
TASK_MOVE 1 0 0 0 0 0 11 : DENIED param7 priority 11 not in 0..10
TASK_ROTATE 0 : DENIED param1 angle is 0: nothing to do
TASK_ROTATE 3601 : DENIED param1 angle 3601 not in -3600..3600
TASK_ROTATE 90 91 : DENIED param2 rate 91 not in 0.1..90
TASK_DRIVE 3 0 1 : DENIED param1 forward speed 3 not in -2..2
TASK_DRIVE 0 0 1 : DENIED param1 speed and param2 rate are 0
TASK_DRIVE 1 0 0 : DENIED param3 duration is 0
NAV_WAYPOINT x=900000001 y=5 frame=6 : DENIED x latitude 90.0000001 not in -90..90
NAV_WAYPOINT x=5 y=-1800000001 frame=6 : DENIED y longitude -180.0000001 not in -180..180
NAV_WAYPOINT frame=6 : DENIED latitude and longitude are 0
NAV_WAYPOINT x=2147483647 y=2147483647 frame=6 : DENIED param5 latitude, param6 longitude
DO_REPOSITION -1 0 0 nan 91 8 : DENIED param5 latitude 91 not in -90..90
DO_REPOSITION -1 0 0 nan nan 8 : DENIED param5 latitude is not given
DO_REPOSITION -1 0 0 90 x=5 y=5 frame=6 : DENIED param4 yaw 90 not in -6.28
DO_REPOSITION -1 3 0 1 x=5 y=5 frame=6 : DENIED param2 relative yaw is not supported
DO_REPOSITION -1 0 -inf nan 47 8 : DENIED param3 is infinite
NAV_RETURN_TO_LAUNCH 0 inf : DENIED param2 is infinite
NAV_DELAY -1 24 : DENIED param2 hour 24 not in -1..23
CONDITION_YAW 0 0 1 1 : DENIED param1 angle is 0: nothing to do
CONDITION_YAW 90 0 2 : DENIED param3 direction 2 not in -1..1
NAV_SET_YAW_SPEED 90 nan : DENIED param2 speed is not given
TASK_MOVE 2 frame=99 : DENIED frame 99 is unknown
"""


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
    check(world, REFUSED)
    reasons = [*[R.BAD_PARAMETER] * (len(REFUSED.split("\n")) - 3), R.BAD_FRAME]
    assert [ack.result_param2 for ack in world.client.acks] == reasons
    assert [event.reason for event in world.events(SubmissionRefused)] == reasons
    assert world.tasks() == ()
