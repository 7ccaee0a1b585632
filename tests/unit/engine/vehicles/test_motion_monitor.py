"""What a vehicle measures of itself, from the two messages that say it."""

from math import inf, nan, pi

import pytest

from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.engine.vehicles.sender_clock import Heard
from mav_tasks.mavlink.messages import Attitude, LocalPositionNed
from mav_tasks.settings import Watch
from mav_tasks.tasks.driving.guidance import Motion
from mav_tasks.tasks.task import Pose

WATCH = Watch()


def position(
    *, ms: int, x: float = 1.0, y: float = 2.0, vx: float = 0.0, vy: float = 0.0
) -> LocalPositionNed:
    return LocalPositionNed(ms, x, y, 0.0, vx, vy, 0.0)


def attitude(*, ms: int, yaw: float = 0.0, rate: float = 0.0) -> Attitude:
    return Attitude(ms, 0.0, 0.0, yaw, 0.0, 0.0, rate)


def monitor(*messages: tuple[float, Attitude | LocalPositionNed]) -> MotionMonitor:
    made = MotionMonitor(WATCH)
    for now, message in messages:
        made.receive(message, now=now)
    return made


def stands(made: MotionMonitor, *, since: float, seconds: float) -> None:
    """Let the vehicle be seen at rest at 20 Hz; a live estimate is never twice quite the same."""
    for step in range(round(seconds / 0.05) + 1):
        now, ms = since + 0.05 * step, round(1000 * (since + 0.05 * step))
        made.receive(position(ms=ms, x=1.0 + 1e-4 * (step % 2)), now=now)
        made.receive(attitude(ms=ms), now=now)


def test_both_messages_are_needed() -> None:
    assert monitor((0.0, position(ms=1))).latest() is None
    assert monitor((0.0, attitude(ms=1))).latest() is None


def test_motion_is_in_the_bodys_axes_and_as_old_as_the_older_message() -> None:
    made = monitor(
        (1.0, position(ms=1, vx=0.0, vy=0.5)), (1.2, attitude(ms=1, yaw=pi / 2, rate=0.1))
    )
    motion = made.latest()
    assert motion is not None
    assert (motion.pose, motion.at) == (Pose(1.0, 2.0, pi / 2), 1.0)
    assert motion.yaw_rate == pytest.approx(0.1)
    assert (motion.forward, motion.sideways) == pytest.approx((0.5, 0.0))


def test_going_east_while_facing_north_is_going_sideways() -> None:
    motion = monitor((0.0, position(ms=1, vy=0.5)), (0.0, attitude(ms=1))).latest()
    assert motion == Motion(Pose(1.0, 2.0, 0.0), 0.0, 0.5, 0.0, 0.0)


@pytest.mark.parametrize("bad", [nan, inf, -inf])
def test_what_is_not_finite_is_dropped(bad: float) -> None:
    made = monitor((0.0, position(ms=1)), (0.0, attitude(ms=1)))
    before = made.latest()
    made.receive(position(ms=2, x=bad), now=1.0)
    made.receive(position(ms=2, vy=bad), now=1.0)
    made.receive(attitude(ms=2, yaw=bad), now=1.0)
    made.receive(attitude(ms=2, rate=bad), now=1.0)
    assert made.latest() == before


def test_what_was_overtaken_on_the_way_is_dropped() -> None:
    made = monitor((0.0, position(ms=1000, x=5.0)), (0.0, attitude(ms=1000)))
    assert made.receive(position(ms=950, x=4.0), now=0.1) is Heard.OLD
    motion = made.latest()
    assert motion is not None
    assert motion.pose.north == 5.0


def test_the_same_again_is_not_news() -> None:
    made = monitor((1.0, position(ms=1000)), (1.0, attitude(ms=1000)))
    made.receive(position(ms=1000), now=1.2)
    made.receive(attitude(ms=1000), now=1.2)
    motion = made.latest()
    assert motion is not None
    assert motion.at == 1.0


def test_a_clock_that_goes_far_back_is_a_restart() -> None:
    made = monitor((0.0, position(ms=60_000)), (0.0, attitude(ms=60_000)))
    assert made.receive(position(ms=500), now=1.0) is Heard.RESTART
    made.forget()
    assert made.latest() is None
    assert made.receive(position(ms=500), now=1.0) is Heard.NEWS


def test_a_clock_that_overflows_is_no_restart() -> None:
    made = monitor((0.0, position(ms=0xFFFFFFF0)), (0.0, attitude(ms=0xFFFFFFF0)))
    assert made.receive(position(ms=16, x=7.0), now=0.05) is Heard.NEWS
    motion = made.latest()
    assert motion is not None
    assert motion.pose.north == 7.0


def test_it_stands_after_it_was_slow_for_a_while() -> None:
    made = MotionMonitor(WATCH)
    made.receive(attitude(ms=900), now=0.9)
    made.receive(position(ms=900, vx=0.5), now=0.9)
    stands(made, since=1.0, seconds=WATCH.still_time - 0.1)
    assert not made.is_still(now=1.0 + WATCH.still_time - 0.1)
    stands(made, since=1.25, seconds=WATCH.still_time)
    assert made.is_still(now=1.25 + WATCH.still_time)


@pytest.mark.parametrize(
    "moving",
    [
        position(ms=5000, vx=0.12),
        position(ms=5000, vy=-0.12),
        position(ms=5000, x=1.05),
        attitude(ms=5000, yaw=0.05, rate=0.05),
    ],
)
def test_any_motion_ends_standing(moving: Attitude | LocalPositionNed) -> None:
    made = MotionMonitor(WATCH)
    stands(made, since=1.0, seconds=2.0)
    assert made.is_still(now=3.0)
    made.receive(moving, now=3.05)
    assert not made.is_still(now=3.05)


def test_without_fresh_data_nobody_knows_whether_it_stands() -> None:
    made = MotionMonitor(WATCH)
    stands(made, since=1.0, seconds=2.0)
    assert not made.is_still(now=3.0 + WATCH.motion_fresh + 0.01)


def test_nothing_heard_since_it_moved_is_no_standstill() -> None:
    """Settings may let data count as fresh for longer than a standstill takes to be seen."""
    made = MotionMonitor(Watch(motion_fresh=2.0, still_time=0.05))
    made.receive(position(ms=1000, vx=1.0), now=1.0)
    made.receive(attitude(ms=1000), now=1.0)
    assert not any(made.is_still(now=1.0 + age) for age in (0.05, 0.3, 1.9))
    made.receive(position(ms=1100, x=1.1), now=1.1)
    assert made.is_still(now=1.1)


def test_what_is_read_late_is_no_younger_than_what_should_have_been_done_meanwhile() -> None:
    made = monitor((1.0, position(ms=1000)), (1.0, attitude(ms=1000)))
    made.receive(position(ms=1400), now=1.4, not_after=1.05)
    made.receive(attitude(ms=1400), now=1.4, not_after=1.05)
    motion = made.latest()
    assert motion is not None
    assert motion.at == 1.05
