"""When tasks will start and end, as far as can be foreseen."""

from math import isnan, nan, pi

import pytest

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.estimate import MOST_STEPS, SETTLING, Known, time_left
from mav_tasks.tasks.forecast import Forecast
from mav_tasks.tasks.goal import (
    Drive,
    Face,
    GlobalPlace,
    Goal,
    GoTo,
    Head,
    Jump,
    LocalPlace,
    Move,
    MoveTurned,
    Plan,
    Rotate,
    SetSpeed,
    SingleGoal,
    Wait,
)
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.outlook import estimate
from mav_tasks.tasks.task import Pose, Progress, Task, Terms
from tests.unit.tasks.rig import BY, Rig, idle, in_control
from tests.unit.tasks.samples import ORIGIN

DRIVING = Driving()
HERE = Known(DRIVING, ORIGIN)
NOWHERE = Known(DRIVING)
EAST_3 = LocalPlace(0.0, 3.0)
QUARTER = time_left(Rotate(pi / 2), Progress(), NOWHERE).seconds - SETTLING
THREE_METRES = time_left(Move(3.0), Progress(), NOWHERE).seconds - SETTLING


class TestTimeLeft:
    @pytest.mark.parametrize(
        ("goal", "seconds"),
        [
            (Move(-5.0, 0.5), 11.0),  # 10 s at 0.5 m/s, and 1 s for ramps of 0.5 m/s²
            (Move(0.02), 0.4),  # ramps only: 2 * sqrt(0.02 / 0.5)
            (Drive(1.0, 0.0, 7.0), 7.0),
            (Wait(3.0), 3.0),
            (Head(0.0, 1.0, 4.0), 4.0),
        ],
    )
    def test_of_what_begins_anywhere(self, goal: SingleGoal, seconds: float) -> None:
        assert time_left(goal, Progress(), NOWHERE).seconds == pytest.approx(SETTLING + seconds)

    @pytest.mark.parametrize("goal", [GoTo(EAST_3), Face(1.0), GoTo(None)])
    def test_of_a_way_whose_beginning_is_unknown_is_unknown(self, goal: SingleGoal) -> None:
        assert isnan(time_left(goal, Progress(), NOWHERE).seconds)

    def test_a_way_is_the_turn_and_the_distance_and_ends_there(self) -> None:
        seconds, pose, _ = time_left(GoTo(EAST_3, wait=4.0), Progress(), HERE)
        assert seconds == pytest.approx(SETTLING + QUARTER + THREE_METRES + 4.0)
        assert pose == pytest.approx(Pose(0.0, 3.0, pi / 2))

    def test_a_place_on_earth_needs_an_origin(self) -> None:
        place = GlobalPlace(473_977_418, 85_455_938)
        assert isnan(time_left(GoTo(place), Progress(), HERE).seconds)
        at_home = Known(DRIVING, ORIGIN, place, place)
        assert time_left(GoTo(None), Progress(), at_home).seconds == pytest.approx(SETTLING)

    def test_of_the_first_leg_of_a_way_counts_the_others_too(self) -> None:
        progress = Progress(anchor=ORIGIN, done=pi / 2, target=EAST_3)
        seconds = time_left(GoTo(EAST_3), progress, HERE).seconds
        assert seconds == pytest.approx(SETTLING + THREE_METRES)

    def test_on_the_way(self) -> None:
        left = time_left(Move(5.0, 0.5), Progress(anchor=ORIGIN, done=2.0), HERE).seconds
        assert left == pytest.approx(SETTLING + 7.0)
        past = time_left(Wait(5.0), Progress(anchor=ORIGIN, done=6.0), HERE).seconds
        assert past == pytest.approx(SETTLING)

    @pytest.mark.parametrize(
        ("goal", "pose"),
        [
            (Move(2.0), Pose(2.0, 0.0, 0.0)),
            (Rotate(pi / 2), Pose(0.0, 0.0, pi / 2)),
            (Head(pi / 2, 0.5, 4.0), Pose(0.0, 2.0, pi / 2)),
            (Drive(0.5, 0.0, 4.0), Pose(2.0, 0.0, 0.0)),
            (Drive(pi / 2, pi / 2, 1.0), Pose(1.0, 1.0, pi / 2)),  # a quarter of a circle of 1 m
        ],
    )
    def test_each_goal_ends_somewhere(self, goal: SingleGoal, pose: Pose) -> None:
        end = time_left(goal, Progress(), HERE).pose
        assert end is not None
        assert (end.north, end.east, end.yaw) == pytest.approx((pose.north, pose.east, pose.yaw))

    @pytest.mark.parametrize(
        ("goal", "metres"),
        [
            (Move(-3.0), 3.0),
            (MoveTurned(2.0), 2.0),
            (Drive(-0.5, 0.1, 4.0), 2.0),
            (Head(1.0, 0.5, 4.0), 2.0),
            (GoTo(LocalPlace(3.0, 4.0), yaw=1.0, wait=2.0), 5.0),
            (Plan((Rotate(1.0), Wait(5.0), Face(1.0))), 0.0),
            (Plan((GoTo(EAST_3), Move(1.0), GoTo(LocalPlace(0.0, 0.0)))), 8.0),
            (Plan((Move(1.0), Jump(0, 2))), 3.0),
            (Plan((Jump(2, -1), Move(100.0), Move(1.0), Jump(4, 1)), first=2), 1.0),
        ],
    )
    def test_the_way_is_that_of_the_whole_task(self, goal: Goal, metres: float) -> None:
        assert time_left(goal, Progress(), HERE).metres == pytest.approx(metres)

    @pytest.mark.parametrize(
        ("goal", "known"),
        [
            (GoTo(None), HERE),
            (GoTo(EAST_3), NOWHERE),
            (GoTo(GlobalPlace(1, 1)), HERE),
            (Plan((Move(1.0), GoTo(EAST_3))), NOWHERE),
            (Plan((Move(0.1), Jump(0, -1))), HERE),
        ],
    )
    def test_a_way_that_nobody_can_know_is_unknown(self, goal: Goal, known: Known) -> None:
        assert isnan(time_left(goal, Progress(), known).metres)

    def test_a_plan_is_its_steps_at_the_speeds_that_it_sets(self) -> None:
        steps = (Wait(5.0), SetSpeed(0.5), Move(5.0), GoTo(LocalPlace(5.0, 0.0)))
        seconds, pose, _ = time_left(Plan(steps), Progress(), HERE)
        assert seconds == pytest.approx(3 * SETTLING + 5.0 + 11.0)  # already there in the end
        assert pose == pytest.approx(Pose(5.0, 0.0, 0.0))

    def test_a_plan_that_goes_on_for_ever_has_no_end(self) -> None:
        plan = Plan((Wait(5.0), Jump(0, -1)))
        assert isnan(time_left(plan, Progress(), HERE).seconds)
        assert isnan(time_left(Plan((Wait(1.0),) * (MOST_STEPS + 1)), Progress(), HERE).seconds)


def times_of(rig: Rig, task: Task) -> tuple[float, float]:
    forecast = Forecast(rig.tasks, rig.registry, now=rig.now)
    return estimate(rig.tasks, rig.task(task.id), forecast=forecast, now=rig.now)


class TestForecast:
    def test_each_task_starts_when_those_before_it_are_done(self) -> None:
        rig = Rig().executing(Wait(100.0))
        second, third = rig.submit(Wait(10.0)), rig.submit(Wait(20.0))
        assert times_of(rig, second) == pytest.approx((101.5, 113.0))
        assert times_of(rig, third) == pytest.approx((113.0, 134.5))

    def test_a_way_begins_where_the_task_before_ends(self) -> None:
        rig = Rig().executing(Move(2.0))
        way = rig.submit(GoTo(LocalPlace(2.0, 3.0)))
        start, end = times_of(rig, way)
        assert end - start == pytest.approx(SETTLING + QUARTER + THREE_METRES)

    def test_one_that_runs_after_another_starts_at_its_end(self) -> None:
        rig = Rig().executing(Wait(100.0))
        last = rig.submit(Wait(10.0), terms=Terms(after=1, priority=3))
        before = rig.submit(Wait(20.0))
        then = rig.submit(Wait(1.0), terms=Terms(after=last.id))
        assert times_of(rig, before) == pytest.approx((101.5, 123.0))
        assert times_of(rig, last) == pytest.approx((123.0, 134.5))  # as urgent as ``then``
        assert times_of(rig, then) == pytest.approx((134.5, 137.0))

    def test_when_one_ends_that_another_gateway_has_is_not_foreseen(self) -> None:
        rig = Rig().executing(Wait(100.0))
        rig.fleet.room.share()
        with rig.fleet.room.told({500: TaskState.EXECUTING}, now=rig.now):
            now = rig.submit(Wait(10.0), terms=Terms(after=500))
            later = rig.submit(Wait(10.0), terms=Terms(after=500, start_at=rig.now + 50.0))
        then = rig.submit(Wait(1.0), terms=Terms(after=now.id))
        other = rig.submit(Wait(1.0))
        assert all(isnan(times_of(rig, each)[1]) for each in (now, later, then))
        assert times_of(rig, other) == pytest.approx((101.5, 104.0))

    def test_one_with_a_start_time_waits_for_it_and_for_its_turn(self) -> None:
        rig = Rig().executing(Wait(100.0))
        early = rig.modify(rig.submit(Wait(10.0)).id, start_at=rig.now + 50.0)
        late = rig.modify(rig.submit(Wait(10.0)).id, start_at=rig.now + 500.0)
        assert times_of(rig, early) == pytest.approx((101.5, 113.0))
        assert times_of(rig, late) == pytest.approx((500.0, 511.5))

    def test_one_with_a_start_time_that_runs_after_another_waits_for_both(self) -> None:
        rig = Rig().executing(Wait(100.0))
        terms = Terms(after=1, start_at=rig.now + 50.0)
        both = rig.submit(Wait(10.0), terms=terms)
        behind = rig.submit(Wait(1.0), terms=Terms(after=both.id, start_at=rig.now + 10.0))
        assert times_of(rig, both) == pytest.approx((101.5, 113.0))
        assert times_of(rig, behind) == pytest.approx((113.0, 115.5))

    def test_behind_what_takes_unknown_time_nothing_is_foreseen(self) -> None:
        rig = Rig().executing(Wait(100.0))
        endless = rig.submit(Plan((Wait(5.0), Jump(0, -1))))
        behind = rig.submit(Wait(10.0))
        assert times_of(rig, endless) == pytest.approx((101.5, nan), nan_ok=True)
        assert times_of(rig, behind) == pytest.approx((nan, nan), nan_ok=True)

    def test_a_paused_queue_has_start_times_only(self) -> None:
        rig = Rig().executing(Wait(100.0))
        waiting = rig.submit(Wait(10.0))
        due = rig.modify(rig.submit(Wait(10.0)).id, start_at=rig.now + 50.0)
        rig.tasks.pause(TaskReason.OPERATOR, actor=BY, now=rig.now)
        assert times_of(rig, waiting) == pytest.approx((nan, nan), nan_ok=True)
        assert times_of(rig, due) == pytest.approx((50.0, nan), nan_ok=True)

    def test_a_plan_that_waits_for_its_start_is_not_foreseen(self) -> None:
        rig = Rig().executing(Wait(100.0))
        staged = rig.submit(Plan((Wait(1.0),)), terms=Terms(is_staged=True))
        assert times_of(rig, staged) == pytest.approx((nan, nan), nan_ok=True)

    def test_of_one_that_is_over_it_is_how_long_ago_it_ended(self) -> None:
        rig = Rig()
        task = rig.submit(Wait(1.0))
        rig.step(idle)
        rig.steps(in_control, seconds=3.0)
        assert rig.task(task.id).state.name == "COMPLETED"
        ended_at = rig.task(task.id).changed_at
        assert ended_at is not None
        rig.pass_time(60.0)
        assert times_of(rig, task) == pytest.approx((nan, ended_at - rig.now), nan_ok=True)
        assert rig.now - ended_at > 60.0

    def test_the_queue_is_empty_when_all_are_done_that_need_not_wait_for_a_time(self) -> None:
        rig = Rig().executing(Wait(100.0))
        rig.submit(Move(3.0))
        rig.submit(Wait(10.0), terms=Terms(after=2))
        rig.modify(rig.submit(Wait(10.0)).id, start_at=rig.now + 5_000.0)
        empty = Forecast(rig.tasks, rig.registry, now=rig.now).when_empty()
        assert empty.seconds == pytest.approx(101.5 + SETTLING + THREE_METRES + 11.5)
        assert empty.pose is not None
        assert empty.pose.north == pytest.approx(3.0)
        rig.tasks.pause(TaskReason.OPERATOR, actor=BY, now=rig.now)
        assert isnan(Forecast(rig.tasks, rig.registry, now=rig.now).when_empty().seconds)

    def test_an_idle_queue_is_empty_now(self) -> None:
        rig = Rig()
        rig.step(idle)
        assert Forecast(rig.tasks, rig.registry, now=rig.now).when_empty().seconds == 0.0

    def test_without_a_forecast_nothing_is_reckoned_for_what_waits(self) -> None:
        rig = Rig().executing(Wait(100.0))
        waiting = rig.submit(Wait(10.0))
        told = estimate(rig.tasks, waiting, forecast=None, now=rig.now)
        assert told == pytest.approx((nan, nan), nan_ok=True)
