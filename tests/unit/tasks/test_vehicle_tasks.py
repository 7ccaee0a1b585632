"""The tasks of one vehicle, driven by hand-made views of it: no MAVLink, no world."""

from dataclasses import replace
from math import pi

import pytest

from mav_tasks.errors import Rejection
from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.events import QueueContinued, QueuePaused, VehicleHalted
from mav_tasks.tasks.goal import Move, Rotate
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.outlook import position, wait_reason
from mav_tasks.tasks.task import Pose, TaskId
from mav_tasks.tasks.view import DemandKind, ModeKind, VehicleView
from tests.unit.tasks.rig import SETTINGS, TICK, Rig, View, at, idle, in_control
from tests.unit.tasks.samples import idle_vehicle, ours

S, R, K = TaskState, TaskReason, DemandKind


class TestFromQueueToEnd:
    def test_a_task_is_started_driven_and_done(self) -> None:
        rig = Rig()
        rig.submit()
        assert rig.step(idle).kind is K.TAKE
        assert rig.step(in_control).velocity.is_zero
        assert rig.step(at(0.0)).velocity.forward > 0
        rig.drive(2.0)
        assert rig.steps(at(2.0, still=True), seconds=1.0).kind is K.HAND_BACK
        assert rig.story() == [
            (1, S.STARTING, R.NONE),
            (1, S.EXECUTING, R.NONE),
            (1, S.COMPLETED, R.NONE),
        ]
        assert rig.tasks.is_idle

    def test_the_first_runs_and_then_the_most_urgent(self) -> None:
        rig = Rig().executing()
        rig.submit(priority=3)
        rig.submit(priority=8)
        assert rig.tasks.waiting == [3, 2]
        rig.drive(2.0)
        rig.steps(at(2.0, still=True), seconds=1.0)
        assert (rig.state(1), rig.state(3), rig.state(2)) == (S.COMPLETED, S.EXECUTING, S.QUEUED)

    def test_nothing_begins_before_its_submission_is_durable(self) -> None:
        rig = Rig()
        rig.keeps = False
        rig.submit()
        assert rig.step(idle).kind is K.HOLD
        assert rig.state(1) is S.QUEUED
        rig.keeps = True
        rig.keep()
        assert rig.step(idle).kind is K.TAKE

    def test_nothing_moves_before_executing_is_durable(self) -> None:
        rig = Rig()
        rig.submit()
        rig.step(idle)
        rig.keeps = False
        rig.step(in_control)
        assert rig.state(1) is S.EXECUTING
        for _ in range(5):
            assert rig.step(in_control).velocity.is_zero
        rig.keeps = True
        rig.keep()
        assert not rig.step(in_control).velocity.is_zero

    def test_motion_begins_ramped(self) -> None:
        rig = Rig().executing()
        speeds = [rig.step(in_control).velocity.forward for _ in range(3)]
        step = SETTINGS.driving.acceleration * TICK
        assert speeds == pytest.approx([step, 2 * step, 3 * step])

    def test_arrived_is_done_only_when_it_stands(self) -> None:
        rig = Rig().executing()
        rig.drive(2.0)
        for _ in range(20):
            assert rig.step(at(2.0)).velocity.is_zero
        assert rig.state(1) is S.EXECUTING

    def test_a_move_counts_from_the_heading_at_its_start(self) -> None:
        rig = Rig()
        rig.submit()
        turned = Pose(5.0, 5.0, pi / 2)
        rig.step(lambda now: idle_vehicle(at=now, pose=turned))
        rig.step(lambda now: ours(at=now, pose=turned, still=True))
        rig.step(lambda now: ours(at=now, pose=replace(turned, east=6.0)))
        assert rig.registry[TaskId(1)].progress.anchor == turned
        assert rig.registry[TaskId(1)].progress.done == pytest.approx(1.0)

    def test_a_rotation_of_more_than_a_turn_goes_all_the_way(self) -> None:
        rig = Rig().executing(Rotate(3 * pi))
        for step in range(1, 301):
            yaw = 3 * pi * step / 300
            rig.step(at(0.0, yaw=(yaw + pi) % (2 * pi) - pi))
            if yaw < 2.9 * pi:
                assert rig.state(1) is S.EXECUTING
        rig.steps(at(0.0, still=True, yaw=pi), seconds=1.0)
        assert rig.state(1) is S.COMPLETED

    def test_execution_time_counts_executing_only(self) -> None:
        rig = Rig().executing()
        rig.steps(in_control, seconds=1.0)
        rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now)
        rig.steps(in_control, seconds=5.0)
        assert rig.registry[TaskId(1)].progress.execution_time == pytest.approx(1.0, abs=2 * TICK)


class TestWaiting:
    def test_a_full_queue_refuses(self) -> None:
        rig = Rig(settings=Settings(queueing=Queueing(capacity=1)))
        rig.submit()
        with pytest.raises(Rejection):
            rig.submit()
        assert rig.tasks.waiting == [1]

    def test_each_says_why_it_waits(self) -> None:
        rig = Rig()
        first, second = rig.submit(), rig.submit()
        rig.step(lambda now: replace(idle(now), mode=ModeKind.OTHER))
        assert [wait_reason(rig.tasks, t) for t in (first, second)] == [
            R.WRONG_MODE,
            R.BEHIND_OTHERS,
        ]
        rig.step(idle)
        assert wait_reason(rig.tasks, second) is R.BEHIND_OTHERS
        assert [position(rig.tasks, t) for t in (first, second)] == [None, 1]
        rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now)
        assert wait_reason(rig.tasks, second) is R.QUEUE_PAUSED

    def test_a_withdrawn_submission_leaves_nothing(self) -> None:
        rig = Rig()
        task = rig.submit()
        rig.tasks.room.withdraw(task, now=rig.now)
        assert (rig.tasks.is_idle, rig.registry.all()) == (True, ())


class TestStarting:
    def test_takes_no_longer_than_its_time(self) -> None:
        rig = Rig()
        rig.submit()
        rig.steps(idle, seconds=SETTINGS.watch.start_timeout + 1.0)
        assert rig.story() == [(1, S.STARTING, R.NONE), (1, S.FAILED, R.START_TIMEOUT)]

    def test_waits_for_standstill_also_after_a_long_wait_for_arming(self) -> None:
        """An ArduPilot that was just switched on refuses to arm for 35 s, and then sways."""
        rig = Rig()
        rig.submit()
        rig.step(idle)
        rig.steps(
            lambda now: replace(idle(now), refusal=R.ARM_REFUSED, is_not_ready=True), seconds=32.0
        )
        assert rig.state(1) is S.STARTING
        rig.step(idle)
        rig.steps(lambda now: ours(at=now, still=False), seconds=2.0)
        assert rig.state(1) is S.STARTING
        rig.steps(in_control, seconds=1.0)
        assert rig.state(1) is S.EXECUTING

    def test_ends_if_the_vehicle_does_not_come_to_stand(self) -> None:
        rig = Rig()
        rig.submit()
        rig.step(idle)

        def rolls(now: float) -> VehicleView:
            seen = ours(at=now)
            assert seen.motion is not None
            return replace(seen, motion=replace(seen.motion, forward=0.5))

        rig.steps(rolls, seconds=2 * SETTINGS.watch.start_timeout + 1.0)
        assert rig.story()[-1] == (1, S.FAILED, R.START_TIMEOUT)

    @pytest.mark.parametrize("reason", [R.MODE_REFUSED, R.ARM_REFUSED])
    def test_ends_when_the_vehicle_refuses(self, reason: TaskReason) -> None:
        rig = Rig()
        rig.submit()
        rig.step(idle)
        rig.step(lambda now: replace(idle(now), refusal=reason))
        assert rig.story()[-1] == (1, S.FAILED, reason)

    def test_a_task_that_never_moved_does_not_stop_the_queue(self) -> None:
        rig = Rig()
        rig.submit()
        rig.submit()
        rig.step(idle)
        rig.step(lambda now: replace(idle(now), refusal=R.ARM_REFUSED))
        assert rig.step(idle).kind is K.TAKE
        assert (rig.state(1), rig.state(2)) == (S.FAILED, S.STARTING)

    def test_waits_for_fresh_motion(self) -> None:
        rig = Rig()
        rig.submit()
        rig.step(idle)
        demand = rig.step(lambda now: ours(at=now - 0.5, still=True))
        assert (rig.state(1), demand.velocity.is_zero) == (S.STARTING, True)


class TestInterruptions:
    def test_old_data_stop_the_motion_at_once(self) -> None:
        rig = Rig().executing()
        assert not rig.step(in_control).velocity.is_zero
        assert rig.step(lambda now: ours(at=now - 0.4)).velocity.is_zero
        assert rig.state(1) is S.EXECUTING

    @pytest.mark.parametrize(
        ("lost", "reason"),
        [
            (lambda now: replace(in_control(now), heard=False), R.LINK_LOST),
            (lambda now: ours(at=now - 1.5), R.POSITION_LOST),
            (lambda now: replace(in_control(now), motion=None), R.POSITION_LOST),
        ],
    )
    def test_a_loss_pauses_and_ends_by_itself_after_good_data(
        self, lost: View, reason: TaskReason
    ) -> None:
        rig = Rig().executing()
        assert rig.step(lost).kind is K.HOLD
        assert rig.story() == [(1, S.PAUSED, reason)]
        rig.steps(lost, seconds=3.0)
        rig.steps(in_control, seconds=SETTINGS.watch.fresh_before_resume - 2 * TICK)
        assert rig.state(1) is S.PAUSED
        rig.steps(in_control, seconds=4 * TICK)
        assert rig.story()[:2] == [(1, S.STARTING, R.NONE), (1, S.EXECUTING, R.NONE)]

    def test_a_loss_that_lasts_fails(self) -> None:
        rig = Rig().executing()
        lost: View = lambda now: replace(in_control(now), heard=False)  # noqa: E731
        rig.steps(lost, seconds=SETTINGS.watch.lost_timeout + 1.0)
        assert rig.story()[-1] == (1, S.FAILED, R.LINK_TIMEOUT)

    def test_a_loss_of_a_vehicle_disarmed_meanwhile_does_not_end_by_itself(self) -> None:
        rig = Rig().executing()
        rig.step(lambda now: replace(in_control(now), heard=False))
        rig.steps(idle, seconds=5.0)
        assert rig.state(1) is S.PAUSED

    def test_an_operators_pause_lasts_until_continued_and_keeps_the_line(self) -> None:
        rig = Rig().executing()
        rig.drive(1.0)
        assert rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now) == 1
        assert rig.step(at(1.0, still=True)).kind is K.HOLD
        rig.steps(at(1.0, still=True), seconds=60.0)
        assert rig.state(1) is S.PAUSED

        view = at(1.0, still=True)
        assert rig.tasks.proceed(view(rig.now), actor="somebody", now=rig.now) == 1
        rig.keep()
        rig.step(view)
        assert rig.story() == [
            (1, S.PAUSED, R.OPERATOR),
            (1, S.STARTING, R.NONE),
            (1, S.EXECUTING, R.NONE),
        ]
        rig.drive(2.0)  # of the original line
        rig.steps(at(2.0, still=True), seconds=1.0)
        assert rig.state(1) is S.COMPLETED

    def test_a_paused_queue_starts_nothing(self) -> None:
        rig = Rig()
        rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now)
        rig.submit()
        rig.steps(idle, seconds=1.0)
        assert rig.state(1) is S.QUEUED
        rig.tasks.proceed(idle(rig.now), actor="somebody", now=rig.now)
        assert rig.step(idle).kind is K.TAKE

    def test_a_vehicle_moved_off_the_line_is_not_driven_back_blindly(self) -> None:
        rig = Rig().executing()
        rig.drive(1.0)
        rig.tasks.pause(R.TAKEOVER, actor="vehicle 1", now=rig.now)
        suspended: View = lambda now: ours(at=now, pose=Pose(1.0, 1.5, 0.0), still=True)  # noqa: E731
        rig.steps(suspended, seconds=1.0)
        rig.tasks.proceed(suspended(rig.now), actor="somebody", now=rig.now)
        assert rig.story()[-1] == (1, S.HELD, R.OFF_TRACK)

    def test_a_position_that_jumps_holds_the_task(self) -> None:
        rig = Rig().executing()
        rig.step(in_control)
        assert rig.step(at(50.0)).kind is K.HOLD
        assert rig.story() == [(1, S.HELD, R.FRAME_RESET)]

    def test_a_held_task_blocks_the_queue(self) -> None:
        rig = Rig().executing()
        second = rig.submit()
        rig.tasks.hold(R.LATE, now=rig.now)
        rig.steps(in_control, seconds=5.0)
        assert (rig.state(1), rig.state(2)) == (S.HELD, S.QUEUED)
        assert wait_reason(rig.tasks, second) is R.HELD_AHEAD

    def test_without_progress_it_fails_and_the_queue_pauses(self) -> None:
        rig = Rig().executing()
        rig.submit()
        rig.steps(in_control, seconds=SETTINGS.watch.stuck + 2.0)
        assert rig.story() == [(1, S.FAILED, R.STUCK)]
        assert (rig.tasks.paused, rig.state(2)) == (R.STUCK, S.QUEUED)

    def test_by_setting_the_queue_goes_on_after_a_failure(self) -> None:
        rig = Rig(settings=replace(SETTINGS, on_failure="continue")).executing()
        rig.submit()
        while rig.state(1) is S.EXECUTING:
            rig.step(in_control)
        rig.step(in_control)
        assert (rig.state(1), rig.tasks.paused) == (S.FAILED, R.NONE)
        assert rig.state(2) in (S.STARTING, S.EXECUTING)


class TestStop:
    def test_kills_what_runs_and_latches(self) -> None:
        rig = Rig().executing()
        rig.submit()
        assert rig.tasks.stop(clear=False, actor="somebody", now=rig.now) == 1
        assert rig.steps(in_control, seconds=5.0).kind is K.STOP
        assert rig.story() == [(1, S.KILLED, R.STOP)]
        assert (rig.tasks.is_stopped, rig.tasks.waiting) == (True, [2])

    def test_can_clear_the_queue(self) -> None:
        rig = Rig().executing()
        rig.submit()
        rig.submit()
        rig.tasks.stop(clear=True, actor="somebody", now=rig.now)
        assert rig.story() == [
            (1, S.KILLED, R.STOP),
            (2, S.CANCELLED, R.CLEARED),
            (3, S.CANCELLED, R.CLEARED),
        ]

    def test_without_a_task_it_latches_all_the_same(self) -> None:
        rig = Rig()
        assert rig.tasks.stop(clear=False, actor="somebody", now=rig.now) is None
        rig.submit()
        rig.steps(idle, seconds=1.0)
        assert (rig.tasks.is_stopped, rig.state(1)) == (True, S.QUEUED)

    def test_no_other_pause_undoes_it(self) -> None:
        rig = Rig()
        rig.tasks.stop(clear=False, actor="somebody", now=rig.now)
        rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now)
        assert rig.tasks.paused is R.STOPPED

    def test_ends_when_somebody_continues(self) -> None:
        rig = Rig()
        rig.tasks.stop(clear=False, actor="a", now=rig.now)
        rig.submit()
        rig.registry.take_events()
        rig.tasks.proceed(idle(rig.now), actor="b", now=rig.now)
        assert rig.registry.take_events() == [QueueContinued(1, "b", rig.now)]
        assert rig.step(idle).kind is K.TAKE

    def test_is_recorded_once(self) -> None:
        rig = Rig()
        for _ in range(3):
            rig.tasks.stop(clear=False, actor="a", now=rig.now)
        assert rig.registry.take_events() == [
            VehicleHalted(1, 2, R.STOPPED, "a", rig.now),
            QueuePaused(1, R.STOPPED, "a", rig.now),
        ]


def test_after_the_last_task_the_vehicle_is_handed_back() -> None:
    rig = Rig()
    assert rig.step(idle).kind is K.HAND_BACK
    rig.submit(Move(2.0))
    rig.tasks.pause(R.OPERATOR, actor="somebody", now=rig.now)
    assert rig.step(idle).kind is K.HOLD
