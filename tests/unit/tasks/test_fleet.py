"""What a restart makes of the tasks of an earlier run."""

from dataclasses import replace

import pytest

from mav_tasks.errors import Rejection
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.fleet import LONG_IDLE, Fleet
from mav_tasks.tasks.goal import Move, Wait
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Frame, Pose, Task, TaskId, Terms, same_frame
from mav_tasks.tasks.view import DemandKind
from tests.unit.tasks.rig import BY, Rig, Rover, idle, in_control, run, run_until
from tests.unit.tasks.samples import draft

S, R = TaskState, TaskReason
HERE = Frame(473_977_418, 85_455_938, 0.0)
LONG = Wait(1000.0)


def in_state(state: TaskState, reason: TaskReason = R.NONE) -> Task:
    task = TaskRegistry().submit(draft(), now=1.0)
    return replace(task, state=state, reason=reason, version=4)


def restored(task: Task, **how: object) -> tuple[Fleet, TaskRegistry]:
    registry = TaskRegistry()
    fleet = Fleet(registry, Settings())
    made = replace(Restored(tasks=(task,), next_id=2), **how)  # type: ignore[arg-type]
    fleet.restore(made, now=10.0)
    return fleet, registry


class TestWhatHadBegun:
    @pytest.mark.parametrize("state", [S.STARTING, S.EXECUTING, S.CANCELLING])
    def test_and_drove_is_held_until_somebody_decides(self, state: TaskState) -> None:
        fleet, registry = restored(in_state(state))
        task = registry[TaskId(1)]
        assert (task.state, task.reason, task.version) == (S.HELD, R.OUTCOME_UNKNOWN, 5)
        assert [fleet.was_driven(1) for _ in range(2)] == [True, False]
        assert fleet.of(1).active == task

    @pytest.mark.parametrize("state", [S.PAUSED, S.HELD])
    def test_and_stood_is_as_it_was(self, state: TaskState) -> None:
        task = in_state(state, R.OPERATOR if state is S.PAUSED else R.LATE)
        fleet, registry = restored(task)
        assert (registry.all(), fleet.was_driven(1)) == ((task,), False)
        assert fleet.of(1).paused is (R.RESTARTED if state is S.PAUSED else R.NONE)

    def test_a_pause_begins_anew_only_when_continued(self) -> None:
        rig, rover = Rig(), Rover(frame=HERE)
        rig.submit(LONG)
        run(rig, rover, seconds=1.0)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        after = rig.restarted(paused={1: R.OPERATOR})
        run(after, rover, seconds=3.0)
        assert (after.states(), after.tasks.paused) == ([S.PAUSED], R.OPERATOR)
        assert after.tasks.proceed(rover.view(after.now), actor=BY, now=after.now) == 1
        run(after, rover, seconds=0.1)
        assert after.states() == [S.EXECUTING]

    def test_what_was_lost_does_not_resume_by_itself(self) -> None:
        rig = Rig().executing(LONG)
        rig.step(lambda now: replace(in_control(now), heard=False))
        after = rig.restarted()
        after.steps(in_control, seconds=60.0)
        assert after.states() == [S.PAUSED]

    def test_the_interrupted_stay_aside_behind_the_one_that_ran(self) -> None:
        rig = Rig().executing(LONG)
        rig.steps(in_control, seconds=2.5)
        rig.submit(LONG, terms=Terms(is_preemptive=True))
        rig.step(in_control)
        after = rig.restarted()
        active = after.tasks.active
        assert active is not None
        assert (active.id, [task.id for task in after.tasks.suspended]) == (2, [1])
        assert after.states() == [S.PAUSED, S.HELD]
        assert after.tasks.paused is R.RESTARTED

    def test_the_exact_remainder_is_driven_after_a_restart(self) -> None:
        rig, rover = Rig(), Rover(Pose(1.0, 2.0, 0.0), frame=HERE)
        rig.submit(Move(4.0))
        run(rig, rover, seconds=4.0)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        run(rig, rover, seconds=1.0)
        after = rig.restarted(paused={1: R.OPERATOR})
        after.tasks.proceed(rover.view(after.now), actor=BY, now=after.now)
        run_until(after, rover, lambda: after.state(1) is S.COMPLETED)
        assert (rover.pose.north, rover.pose.east) == pytest.approx((5.0, 2.0), abs=0.03)

    @pytest.mark.parametrize(
        "frame",
        [None, replace(HERE, latitude_degE7=473_977_618), replace(HERE, booted_at=60.0)],
    )
    def test_a_line_in_another_frame_is_not_driven_on(self, frame: Frame | None) -> None:
        rig, rover = Rig(), Rover(frame=HERE)
        rig.submit(Move(4.0))
        run(rig, rover, seconds=3.0)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        after = rig.restarted(paused={1: R.OPERATOR})
        rover.frame = frame
        after.tasks.proceed(rover.view(after.now), actor=BY, now=after.now)
        assert (after.task(1).state, after.task(1).reason) == (S.HELD, R.FRAME_RESET)

    @pytest.mark.parametrize("frame", [HERE, replace(HERE, booted_at=60.0)])
    def test_the_remainder_of_an_unknown_outcome_is_known_only_in_the_same_frame(
        self, frame: Frame
    ) -> None:
        rig, rover = Rig(), Rover(frame=HERE)
        rig.submit(Move(4.0))
        run(rig, rover, seconds=4.0)
        after = rig.restarted()
        rover.frame = frame
        if frame == HERE:
            run(after, rover, seconds=1.0)
            seen = rover.view(after.now)
            after.tasks.releases.release(
                after.task(1), again=False, may_continue=True, seen=seen, actor=BY, now=after.now
            )
            run_until(after, rover, lambda: after.state(1) is S.COMPLETED)
            assert rover.pose.north == pytest.approx(4.0, abs=0.03)
        else:
            seen = rover.view(after.now)
            with pytest.raises(Rejection, match="is unknown: choose again or skip"):
                after.tasks.releases.release(
                    after.task(1),
                    again=False,
                    may_continue=True,
                    seen=seen,
                    actor=BY,
                    now=after.now,
                )
            assert after.state(1) is S.HELD


class TestTheQueue:
    @pytest.mark.parametrize(
        ("ended_well", "idle_for", "paused"),
        [
            (True, 0.0, R.NONE),
            (True, LONG_IDLE, R.NONE),
            (True, LONG_IDLE + 1.0, R.RESTARTED),
            (False, 0.0, R.RESTARTED),
        ],
    )
    def test_stands_after_an_unclean_end_or_a_long_one(
        self, ended_well: bool, idle_for: float, paused: TaskReason
    ) -> None:
        fleet, registry = restored(in_state(S.QUEUED), ended_well=ended_well, idle=idle_for)
        assert fleet.of(1).paused is paused
        events = [e for e in registry.take_events() if isinstance(e, QueuePaused)]
        assert [e.reason for e in events] == ([paused] if paused else [])

    def test_of_a_vehicle_met_after_an_unclean_end_stands_and_is_remembered(self) -> None:
        fleet, registry = restored(in_state(S.QUEUED), ended_well=False)
        registry.take_events()
        assert fleet.of(7).paused is R.RESTARTED
        (event,) = [event for event in registry.take_events() if isinstance(event, QueuePaused)]
        assert (event.vehicle, event.reason) == (7, R.RESTARTED)

    def test_goes_on_by_setting(self) -> None:
        registry = TaskRegistry()
        fleet = Fleet(registry, Settings(on_restart="continue"))
        fleet.restore(Restored((in_state(S.QUEUED),), 2, ended_well=False), now=10.0)
        assert fleet.of(1).paused is R.NONE

    def test_a_stop_is_still_latched(self) -> None:
        rig = Rig()
        rig.submit()
        rig.tasks.stop(clear=False, actor=BY, now=rig.now)
        after = rig.restarted(paused={1: R.STOPPED, 2: R.STOPPED}, ended_well=False)
        assert after.tasks.is_stopped
        assert after.fleet.of(2).is_stopped
        assert after.steps(idle, seconds=1.0).kind is DemandKind.STOP
        after.tasks.proceed(idle(after.now), actor=BY, now=after.now)
        assert after.step(idle).kind is DemandKind.TAKE

    def test_is_in_the_same_order(self) -> None:
        rig = Rig()
        for priority in (5, 10, 0, 7):
            rig.submit(priority=priority)
            rig.pass_time(100.0)
        late = rig.submit(priority=8, terms=Terms(priority=8, start_at=rig.now + 50.0))
        rig.submit(terms=Terms(priority=9, after=3))
        rig.pass_time(60.0)
        rig.submit(priority=8)
        rig.submit(terms=Terms(start_at=rig.now + 50.0))
        assert late.id in rig.tasks.waiting
        after = rig.restarted()
        assert after.tasks.waiting == rig.tasks.waiting
        assert after.registry.all() == rig.registry.all()

    def test_what_waits_for_a_held_task_still_does(self) -> None:
        rig = Rig().executing(LONG)
        rig.submit(vehicle=2, terms=Terms(after=1))
        after = rig.restarted()
        assert after.states() == [S.HELD, S.BLOCKED]
        after.cancel(1)
        assert after.states() == [S.CANCELLED, S.FAILED]

    def test_what_was_due_meanwhile_is_ready_or_over(self) -> None:
        rig = Rig()
        rig.submit(terms=Terms(start_at=15.0))
        rig.submit(terms=Terms(deadline=15.0))
        rig.submit(terms=Terms(start_utc=1020))
        rig.now = 30.0
        after = rig.restarted(wall_offset=1000.0)
        after.pass_time(0.0)
        assert after.states() == [S.QUEUED, S.EXPIRED, S.QUEUED]

    def test_ids_go_on(self) -> None:
        fleet, _ = restored(in_state(S.COMPLETED))
        assert fleet.of(1).submit(draft(), now=11.0).id == 2


class TestTheVehicle:
    def test_has_the_speed_that_was_set(self) -> None:
        rig, rover = Rig(), Rover()
        rig.fleet.restore(Restored(speeds={1: 1.25}), now=rig.now)
        rig.submit(Move(20.0))
        run(rig, rover, seconds=5.0)
        assert rover.velocity.forward == pytest.approx(1.25)


class TestTheFrameOfTheSameVehicle:
    """``same_frame``: one that comes from another estimate of the origin, or a slow clock."""

    def test_is_the_same_where_its_origin_was_worked_out_anew(self) -> None:
        again = replace(HERE, latitude_degE7=473_977_419, longitude_degE7=85_455_929)
        assert same_frame(HERE, again)
        assert not same_frame(HERE, replace(HERE, latitude_degE7=473_977_418 + 11))
        assert not same_frame(HERE, replace(HERE, longitude_degE7=85_455_938 - 11))

    @pytest.mark.parametrize("away", [64.0, 600.0, 7200.0])
    def test_is_the_same_by_a_clock_that_runs_at_nine_tenths(self, away: float) -> None:
        before = replace(HERE, booted_at=0.0, heard_at=100.0)
        after = replace(HERE, booted_at=0.1 * away, heard_at=100.0 + away)
        assert same_frame(before, after)

    def test_is_another_one_after_another_boot(self) -> None:
        before = replace(HERE, booted_at=0.0, heard_at=100.0)
        assert not same_frame(before, replace(HERE, booted_at=101.0, heard_at=164.0))
        assert not same_frame(before, replace(HERE, booted_at=2.0e3, heard_at=2.1e3))
