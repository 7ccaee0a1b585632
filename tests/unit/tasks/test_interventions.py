"""What clients do to tasks that wait, have begun, or were set aside."""

from dataclasses import replace

import pytest

from mav_tasks.errors import Rejection
from mav_tasks.settings import Queueing
from mav_tasks.tasks.goal import Move, Wait
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.outlook import wait_reason
from mav_tasks.tasks.task import Frame, Pose, Terms
from mav_tasks.tasks.view import DemandKind, ModeKind, VehicleView
from tests.unit.tasks.rig import (
    BY,
    SETTINGS,
    TICK,
    Rig,
    Rover,
    at,
    idle,
    in_control,
    run,
    run_until,
    with_queueing,
)
from tests.unit.tasks.samples import draft, ours

S, R, K = TaskState, TaskReason, DemandKind
LONG = Wait(1000.0)
HERE = Frame(473_977_418, 85_455_938, 0.0)


def active() -> Rig:
    return Rig().executing(LONG)


def interrupted(*, queueing: Queueing | None = None) -> Rig:
    """Task 1 is set aside, task 2 runs."""
    settings = with_queueing(queueing or Queueing(preemption_rest=0.0))
    rig = Rig(settings=settings).executing(LONG)
    rig.submit(LONG, terms=Terms(is_preemptive=True))
    rig.step(in_control)
    assert rig.states() == [S.PAUSED, S.EXECUTING]
    rig.story()
    return rig


def test_a_task_whose_vehicle_is_not_in_control_again_in_time_fails() -> None:
    """Whatever took it, nobody was told: the task does not stand there for ever."""
    rig = active()
    lost = SETTINGS.watch.start_timeout - TICK

    def out_of_control(now: float) -> VehicleView:
        return replace(in_control(now), in_control=False)

    assert rig.steps(out_of_control, seconds=lost).kind is K.TAKE
    assert rig.step(in_control).kind is not K.TAKE
    rig.steps(out_of_control, seconds=lost)
    assert rig.story() == []
    rig.steps(out_of_control, seconds=3 * TICK)
    assert rig.story() == [(1, S.FAILED, R.START_TIMEOUT)]


class TestCancel:
    def test_what_waits_is_over_at_once_and_what_waits_for_it_fails(self) -> None:
        rig = active()
        rig.submit()
        rig.submit(terms=Terms(after=2), vehicle=2)
        rig.cancel(2)
        assert rig.story() == [(2, S.CANCELLED, R.CANCELLED), (3, S.FAILED, R.DEPENDENCY_FAILED)]

    def test_what_runs_is_over_when_it_stands(self) -> None:
        rig = active()
        rig.submit(LONG)
        rig.cancel(1)
        assert rig.step(lambda now: ours(at=now)).kind is K.HOLD
        assert rig.states() == [S.CANCELLING, S.QUEUED]
        rig.steps(in_control, seconds=2 * TICK)
        assert rig.states() == [S.CANCELLED, S.EXECUTING]

    def test_what_does_not_stand_in_time_is_held_and_stopped_until_it_does(self) -> None:
        rig = active()
        rig.cancel(1)
        rig.steps(lambda now: ours(at=now), seconds=SETTINGS.watch.stop_unconfirmed + 2 * TICK)
        assert rig.story() == [(1, S.CANCELLING, R.CANCELLED), (1, S.HELD, R.STOP_UNCONFIRMED)]
        assert rig.step(lambda now: ours(at=now)).kind is K.HALT
        assert rig.step(in_control).kind is K.HOLD

    def test_what_was_set_aside_is_over_at_once(self) -> None:
        rig = interrupted()
        rig.cancel(1)
        assert rig.story() == [(1, S.CANCELLING, R.CANCELLED), (1, S.CANCELLED, R.CANCELLED)]
        assert (rig.tasks.suspended, rig.state(2)) == ([], S.EXECUTING)

    def test_a_paused_one_goes_and_the_queue_stands_as_before(self) -> None:
        rig = active()
        rig.submit(LONG)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        rig.cancel(1)
        rig.steps(in_control, seconds=1.0)
        assert (rig.states(), rig.tasks.paused) == ([S.CANCELLED, S.QUEUED], R.OPERATOR)

    def test_a_failed_dependency_reaches_through_chains_and_vehicles(self) -> None:
        rig = active()
        rig.submit(vehicle=2, terms=Terms(after=1))
        rig.submit(vehicle=3, terms=Terms(after=2))
        rig.cancel(1)
        rig.step(in_control)
        assert rig.states() == [S.CANCELLED, S.FAILED, S.FAILED]


class TestKill:
    def test_nothing_begins_before_the_vehicle_stands(self) -> None:
        rig = active()
        rig.submit(LONG)
        rig.cancel(1, kill=True)
        assert rig.story() == [(1, S.KILLED, R.CANCELLED)]
        assert rig.steps(lambda now: ours(at=now), seconds=2.0).kind is K.HALT
        assert rig.state(2) is S.QUEUED
        rig.steps(in_control, seconds=2 * TICK)
        assert (rig.state(2), rig.tasks.paused) == (S.EXECUTING, R.NONE)

    def test_of_a_waiting_or_an_interrupted_one_leaves_the_running_one_alone(self) -> None:
        rig = interrupted()
        rig.submit()
        rig.cancel(3, kill=True)
        rig.cancel(1, kill=True)
        assert rig.story() == [(3, S.KILLED, R.CANCELLED), (1, S.KILLED, R.CANCELLED)]
        rig.step(in_control)
        assert rig.state(2) is S.EXECUTING

    def test_a_cancelling_one_can_be_killed(self) -> None:
        rig = active()
        rig.cancel(1)
        rig.cancel(1, kill=True)
        assert rig.state(1) is S.KILLED


class TestHeldTasks:
    def held(self, reason: TaskReason = R.LATE) -> Rig:
        rig = Rig().executing(Move(4.0))
        rig.drive(1.0)
        rig.tasks.hold(reason, now=rig.now)
        assert rig.state(1) is S.HELD
        return rig

    def release(self, rig: Rig, rover: Rover, *, again: bool, task_id: int = 1) -> None:
        seen = rover.view(rig.now)
        rig.tasks.releases.release(
            rig.task(task_id), again=again, may_continue=True, seen=seen, actor=BY, now=rig.now
        )
        rig.keep()

    @pytest.mark.parametrize(("again", "end"), [(True, 5.0), (False, 4.0)])
    def test_again_is_all_of_it_from_here_and_the_remainder_is_the_rest(
        self, again: bool, end: float
    ) -> None:
        rig, rover = self.held(), Rover(Pose(1.0, 0.0, 0.0))
        self.release(rig, rover, again=again)
        run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)
        assert rover.pose.north == pytest.approx(end, abs=0.03)

    @pytest.mark.parametrize("reason", [R.OFF_TRACK, R.FRAME_RESET])
    def test_the_remainder_counts_from_here_where_the_line_is_lost(
        self, reason: TaskReason
    ) -> None:
        rig, rover = self.held(reason), Rover(Pose(4.0, 2.0, 0.0))
        run(rig, rover, seconds=2.0)
        self.release(rig, rover, again=False)
        run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)
        assert (rover.pose.north, rover.pose.east) == pytest.approx((7.0, 2.0), abs=0.03)

    def test_skipped_is_cancelled_and_the_queue_goes_on(self) -> None:
        rig = self.held()
        rig.submit(LONG)
        rig.tasks.cancel(rig.task(1), kill=False, reason=R.SKIPPED, actor=BY, now=rig.now)
        rig.steps(lambda now: ours(at=now, pose=Pose(1.0, 0.0, 0.0), still=True), seconds=1.0)
        assert (rig.task(1).state, rig.task(1).reason) == (S.CANCELLED, R.SKIPPED)
        assert rig.state(2) is S.EXECUTING

    def test_is_not_released_while_it_could_not_take_the_vehicle(self) -> None:
        rig = self.held()
        before = rig.registry.all()
        seen = replace(in_control(rig.now), mode=ModeKind.OTHER)
        with pytest.raises(Rejection) as refusal:
            rig.tasks.releases.release(
                rig.task(1), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
            )
        assert (refusal.value.reason, rig.registry.all()) == (R.WRONG_MODE, before)

    def test_a_reset_frame_holds_what_was_set_aside_too_and_each_is_released_by_itself(
        self,
    ) -> None:
        rig = interrupted()
        rig.tasks.hold(R.FRAME_RESET, now=rig.now)
        assert rig.states() == [S.HELD, S.HELD]
        seen = in_control(rig.now)
        rig.tasks.releases.release(
            rig.task(1), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
        )
        assert ([t.id for t in rig.tasks.suspended], rig.states()) == ([2], [S.STARTING, S.HELD])
        with pytest.raises(Rejection, match="task 1 is starting"):
            rig.tasks.releases.release(
                rig.task(2), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
            )
        rig.cancel(1)
        rig.steps(in_control, seconds=2 * TICK)
        rig.tasks.releases.release(
            rig.task(2), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
        )
        assert rig.states() == [S.CANCELLED, S.STARTING]

    def test_a_jump_holds_what_was_set_aside_too(self) -> None:
        rig = Rig().executing(Move(4.0))
        rig.drive(1.0)
        rig.steps(at(1.0), seconds=1.0)
        rig.submit(LONG, terms=Terms(is_preemptive=True))
        rig.steps(at(1.0, still=True), seconds=0.5)
        assert rig.states() == [S.PAUSED, S.EXECUTING]
        rig.step(at(51.0, still=True))
        assert [(t.state, t.reason) for t in rig.registry.all()] == [(S.HELD, R.FRAME_RESET)] * 2

    def test_where_it_was_before_a_reset_is_not_held_against_it(self) -> None:
        rig, rover = self.held(R.FRAME_RESET), Rover(Pose(500.0, 0.0, 0.0))
        run(rig, rover, seconds=10.0)
        self.release(rig, rover, again=True)
        run(rig, rover, seconds=2.0)
        assert rig.state(1) is S.EXECUTING

    def test_released_before_a_paused_one_it_takes_its_place(self) -> None:
        rig, rover = Rig(), Rover(frame=HERE)
        rig.submit(LONG)
        run(rig, rover, seconds=1.0)
        rig.tasks.run_now(draft(LONG), in_control(rig.now), actor=BY, now=rig.now)
        rig.keep()
        run(rig, rover, seconds=1.0)
        assert rig.states() == [S.PAUSED, S.EXECUTING]
        rig = rig.restarted(paused={1: R.OPERATOR})
        assert rig.states() == [S.PAUSED, S.HELD]
        self.release(rig, rover, again=True, task_id=2)
        run(rig, rover, seconds=1.0)
        assert rig.states() == [S.PAUSED, S.HELD], "the queue is paused"
        rig.tasks.proceed(rover.view(rig.now), actor=BY, now=rig.now)
        run(rig, rover, seconds=1.0)
        assert rig.states() == [S.PAUSED, S.EXECUTING]
        rig.cancel(2)
        run(rig, rover, seconds=1.0)
        assert rig.states() == [S.EXECUTING, S.CANCELLED]

    def test_continuing_says_that_it_must_be_released(self) -> None:
        rig = self.held()
        with pytest.raises(
            Rejection, match=r"task 1 is held \(server was late\): release it \(again"
        ):
            rig.tasks.proceed(in_control(rig.now), actor=BY, now=rig.now)


class TestRunNow:
    def test_what_runs_is_set_aside_and_goes_on_when_continued(self) -> None:
        rig = active()
        rig.submit(LONG)
        rig.tasks.run_now(draft(Wait(1.0)), in_control(rig.now), actor=BY, now=rig.now)
        rig.keep()
        rig.steps(in_control, seconds=0.5)
        assert rig.states() == [S.PAUSED, S.QUEUED, S.EXECUTING]
        rig.steps(in_control, seconds=3.0)
        assert (rig.states(), rig.tasks.paused) == ([S.PAUSED, S.QUEUED, S.COMPLETED], R.OPERATOR)
        rig.tasks.proceed(in_control(rig.now), actor=BY, now=rig.now)
        rig.steps(in_control, seconds=2 * TICK)
        assert rig.states() == [S.EXECUTING, S.QUEUED, S.COMPLETED]

    def test_another_one_replaces_it_whether_begun_or_not(self) -> None:
        rig = active()
        rig.keeps = False
        rig.tasks.run_now(draft(LONG), in_control(rig.now), actor=BY, now=rig.now)
        rig.tasks.run_now(draft(LONG), in_control(rig.now), actor=BY, now=rig.now)
        assert (rig.state(2), rig.task(2).reason) == (S.CANCELLED, R.REPLACED)
        rig.keeps = True
        rig.keep()
        rig.steps(in_control, seconds=2 * TICK)
        rig.tasks.run_now(draft(LONG), in_control(rig.now), actor=BY, now=rig.now)
        rig.keep()
        rig.steps(in_control, seconds=3 * TICK)
        assert rig.states() == [S.PAUSED, S.CANCELLED, S.CANCELLED, S.EXECUTING]

    def test_is_refused_under_stop_without_a_trace(self) -> None:
        rig = active()
        rig.tasks.stop(clear=False, actor=BY, now=rig.now)
        with pytest.raises(Rejection) as refusal:
            rig.tasks.run_now(draft(), in_control(rig.now), actor=BY, now=rig.now)
        assert (refusal.value.reason, rig.states()) == (R.STOPPED, [S.KILLED])

    def test_is_refused_where_it_could_not_run_now(self) -> None:
        rig = active()
        by_hand = replace(idle(rig.now), mode=ModeKind.MANUAL, armed=True)
        before = (rig.registry.all(), rig.registry.recorded)
        with pytest.raises(Rejection) as refusal:
            rig.tasks.run_now(draft(), by_hand, actor=BY, now=rig.now)
        assert refusal.value.reason == R.WRONG_MODE
        assert (rig.registry.all(), rig.registry.recorded) == before

    def test_waits_as_any_other_once_the_queue_is_paused(self) -> None:
        rig = Rig()
        rig.tasks.run_now(draft(), in_control(rig.now), actor=BY, now=rig.now)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        rig.keep()
        rig.steps(in_control, seconds=2.0)
        assert rig.states() == [S.QUEUED]
        assert wait_reason(rig.tasks, rig.task(1)) is R.QUEUE_PAUSED


class TestClear:
    def test_of_what_waits_leaves_what_has_begun(self) -> None:
        rig = interrupted()
        rig.submit()
        rig.submit(terms=Terms(after=3))
        rig.submit(vehicle=2)
        rig.submit(vehicle=2, terms=Terms(after=4))
        rig.tasks.clear(begun_too=False, actor=BY, now=rig.now)
        states = [S.PAUSED, S.EXECUTING, S.CANCELLED, S.CANCELLED, S.QUEUED, S.FAILED]
        assert rig.states() == states

    def test_of_everything_ends_what_was_set_aside_and_what_runs(self) -> None:
        rig = interrupted()
        rig.submit(terms=Terms(after=2))
        rig.tasks.clear(begun_too=True, actor=BY, now=rig.now)
        rig.keep()
        rig.steps(in_control, seconds=2 * TICK)
        assert [(t.state, t.reason) for t in rig.registry.all()] == [(S.CANCELLED, R.CLEARED)] * 3
        assert rig.tasks.is_idle


class TestStop:
    def test_kills_what_runs_and_keeps_what_was_set_aside_for_later(self) -> None:
        rig = interrupted()
        assert rig.tasks.stop(clear=False, actor=BY, now=rig.now) == 2
        assert rig.steps(in_control, seconds=1.0).kind is K.STOP
        assert rig.states() == [S.PAUSED, S.KILLED]
        rig.tasks.proceed(in_control(rig.now), actor=BY, now=rig.now)
        rig.steps(in_control, seconds=2 * TICK)
        assert rig.states() == [S.EXECUTING, S.KILLED]

    def test_with_clear_leaves_nothing(self) -> None:
        rig = interrupted()
        rig.submit(terms=Terms(after=2))
        rig.submit(vehicle=2, terms=Terms(after=2))
        rig.tasks.stop(clear=True, actor=BY, now=rig.now)
        assert rig.states() == [S.CANCELLED, S.KILLED, S.CANCELLED, S.FAILED]

    def test_is_released_first_and_then_what_is_held(self) -> None:
        rig = interrupted()
        rig.tasks.hold(R.FRAME_RESET, now=rig.now)
        rig.tasks.stop(clear=False, actor=BY, now=rig.now)
        assert rig.states() == [S.HELD, S.KILLED]
        assert rig.tasks.proceed(in_control(rig.now), actor=BY, now=rig.now) is None
        rig.steps(in_control, seconds=1.0)
        assert rig.states() == [S.HELD, S.KILLED]
        seen = in_control(rig.now)
        rig.tasks.releases.release(
            rig.task(1), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
        )
        rig.keep()
        rig.steps(in_control, seconds=2 * TICK)
        assert rig.states() == [S.EXECUTING, S.KILLED]

    def test_fails_what_waits_for_what_it_killed(self) -> None:
        rig = active()
        rig.submit(terms=Terms(after=1))
        rig.tasks.stop(clear=False, actor=BY, now=rig.now)
        assert rig.states() == [S.KILLED, S.FAILED]


class TestProceed:
    def test_is_refused_and_changes_nothing_while_the_vehicle_cannot_be_taken(self) -> None:
        rig = active()
        rig.tasks.pause(R.TAKEOVER, actor="vehicle 1", now=rig.now)
        before = (rig.registry.all(), rig.registry.recorded, rig.tasks.paused)
        seen = replace(idle(rig.now), mode=ModeKind.MANUAL, armed=True)
        with pytest.raises(Rejection) as refusal:
            rig.tasks.proceed(seen, actor=BY, now=rig.now)
        assert refusal.value.reason == R.WRONG_MODE
        assert (rig.registry.all(), rig.registry.recorded, rig.tasks.paused) == before

    def test_without_a_pause_it_is_no_event(self) -> None:
        rig = Rig()
        assert rig.tasks.proceed(idle(rig.now), actor=BY, now=rig.now) is None
        assert rig.registry.take_events() == []

    def test_what_failed_and_had_moved_is_looked_at_first(self) -> None:
        rig = Rig().executing(Move(2.0))
        rig.submit(LONG)
        rig.steps(in_control, seconds=SETTINGS.watch.stuck + 1.0)
        assert (rig.states(), rig.tasks.paused) == ([S.FAILED, S.QUEUED], R.STUCK)
        rig.tasks.proceed(in_control(rig.now), actor=BY, now=rig.now)
        rig.steps(in_control, seconds=2 * TICK)
        assert rig.state(2) is S.EXECUTING


def test_a_set_speed_is_that_of_the_running_task_and_of_those_that_name_none() -> None:
    rig, rover = Rig(), Rover()
    rig.submit(Move(20.0, speed=0.3))
    run(rig, rover, seconds=3.0)
    assert rover.velocity.forward == pytest.approx(0.3)
    assert rig.tasks.set_speed(1.0, actor=BY, now=rig.now) == 1
    run(rig, rover, seconds=3.0)
    assert rover.velocity.forward == pytest.approx(1.0)
    run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)
    rig.submit(Move(20.0))
    rig.submit(Move(20.0, speed=0.3))
    run(rig, rover, seconds=5.0)
    assert rover.velocity.forward == pytest.approx(1.0)
    run_until(rig, rover, lambda: rig.state(2) is S.COMPLETED)
    run(rig, rover, seconds=5.0)
    assert rover.velocity.forward == pytest.approx(0.3)


def test_what_is_too_late_is_not_begun_though_its_deadline_was_not_looked_at_yet() -> None:
    rig = Rig()
    rig.submit(terms=Terms(deadline=rig.now + 5.0))
    rig.submit(priority=0)
    rig.now += 5.0  # nobody was called meanwhile
    assert rig.tasks.step(idle(rig.now), now=rig.now).kind is K.TAKE
    assert rig.states() == [S.EXPIRED, S.STARTING]
