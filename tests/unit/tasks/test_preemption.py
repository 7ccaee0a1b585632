"""Who may interrupt whom, when, and that what is interrupted ends where it would have ended."""

from dataclasses import replace
from math import cos, hypot, pi, radians, sin

import pytest

from mav_tasks.settings import Queueing
from mav_tasks.tasks.driving.guidance import wrap
from mav_tasks.tasks.goal import Drive, Goal, Move, Rotate, Wait
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.outlook import wait_reason
from mav_tasks.tasks.task import Pose, Terms
from mav_tasks.tasks.view import ModeKind
from tests.unit.tasks.rig import (
    BY,
    SETTINGS,
    TICK,
    Rig,
    Rover,
    idle,
    in_control,
    run,
    run_until,
    with_queueing,
)

S, R = TaskState, TaskReason
LONG = Wait(1000.0)
REST = SETTINGS.queueing.preemption_rest
URGENT = Terms(is_preemptive=True)


def running(terms: Terms, *, queueing: Queueing | None = None) -> Rig:
    """One task that waits at the origin for long, past its rest."""
    rig = Rig(settings=with_queueing(queueing or Queueing()))
    rig.submit(LONG, terms=terms)
    rig.step(idle)
    rig.steps(in_control, seconds=REST + 2 * TICK)
    assert rig.states() == [S.EXECUTING]
    rig.story()
    return rig


class TestWhoMayInterrupt:
    def test_nobody_by_priority_alone_unless_set(self) -> None:
        rig = running(Terms(priority=0))
        rig.submit(LONG, priority=10)
        rig.steps(in_control, seconds=5.0)
        assert rig.states() == [S.EXECUTING, S.QUEUED]

    def test_who_is_marked_whatever_its_priority(self) -> None:
        rig = running(Terms(priority=9))
        rig.submit(LONG, terms=Terms(priority=0, is_preemptive=True))
        rig.step(in_control)
        assert rig.story() == [
            (1, S.PAUSED, R.PREEMPTED),
            (2, S.STARTING, R.NONE),
            (2, S.EXECUTING, R.NONE),
        ]
        assert [task.id for task in rig.tasks.suspended] == [1]

    def test_who_is_marked_even_behind_others_in_the_queue(self) -> None:
        rig = running(Terms())
        rig.submit(LONG, priority=8)
        rig.submit(LONG, terms=Terms(priority=1, is_preemptive=True))
        rig.step(in_control)
        assert rig.states() == [S.PAUSED, S.QUEUED, S.EXECUTING]

    @pytest.mark.parametrize(("priority", "state"), [(7, S.EXECUTING), (8, S.PAUSED)])
    def test_who_outranks_by_the_gap(self, priority: int, state: TaskState) -> None:
        rig = running(Terms(priority=5), queueing=Queueing(preemption_gap=3))
        rig.submit(LONG, priority=priority)
        rig.step(in_control)
        assert rig.states()[0] is state

    def test_neither_age_nor_who_waits_for_it_counts(self) -> None:
        rig = running(Terms(priority=5), queueing=Queueing(preemption_gap=3, aging=60.0))
        needed = rig.submit(LONG, priority=5)
        rig.submit(LONG, terms=Terms(priority=10, after=needed.id))
        rig.pass_time(600.0)
        rig.steps(in_control, seconds=3.0)
        assert rig.states() == [S.EXECUTING, S.QUEUED, S.BLOCKED]

    def test_who_outranks_is_not_hidden_by_who_has_waited_long(self) -> None:
        rig = running(Terms(priority=2), queueing=Queueing(preemption_gap=3, aging=60.0))
        rig.submit(LONG, priority=4)
        rig.pass_time(600.0)
        rig.submit(LONG, priority=9)
        rig.steps(in_control, seconds=3.0)
        assert rig.states() == [S.PAUSED, S.QUEUED, S.EXECUTING]

    def test_nobody_whom_the_running_task_forbids_it(self) -> None:
        rig = running(Terms(is_preemptible=False), queueing=Queueing(preemption_gap=1))
        rig.submit(LONG, terms=replace(URGENT, priority=10))
        rig.steps(in_control, seconds=3.0)
        assert rig.states() == [S.EXECUTING, S.QUEUED]
        rig.modify(1, is_preemptible=True)
        rig.step(in_control)
        assert rig.states() == [S.PAUSED, S.EXECUTING]

    @pytest.mark.parametrize(("priority", "state"), [(5, S.EXECUTING), (6, S.PAUSED)])
    def test_of_two_marked_ones_only_the_more_urgent(self, priority: int, state: TaskState) -> None:
        rig = running(URGENT)
        rig.submit(LONG, terms=replace(URGENT, priority=priority))
        rig.step(in_control)
        assert rig.states()[0] is state

    def test_a_waiting_task_that_is_marked_later(self) -> None:
        rig = running(Terms())
        rig.submit(LONG)
        rig.step(in_control)
        rig.modify(2, is_preemptive=True)
        rig.step(in_control)
        assert rig.states() == [S.PAUSED, S.EXECUTING]


class TestWhen:
    def test_a_task_runs_for_a_while_before_it_is_interrupted(self) -> None:
        rig = Rig()
        rig.submit(LONG)
        rig.submit(LONG, terms=URGENT)
        rig.modify(2, start_at=rig.now + 1.0)
        rig.step(idle)
        begun_at = rig.now
        while rig.state(1) is not S.PAUSED:
            rig.step(in_control)
        assert rig.now - begun_at == pytest.approx(REST, abs=1.5 * TICK)

    def test_not_before_it_is_durable(self) -> None:
        rig = running(Terms())
        rig.keeps = False
        rig.submit(LONG, terms=URGENT)
        rig.step(in_control)
        assert rig.states() == [S.EXECUTING, S.QUEUED]
        rig.keeps = True
        rig.keep()
        rig.step(in_control)
        assert rig.states() == [S.PAUSED, S.EXECUTING]

    def test_not_while_the_other_could_not_begin(self) -> None:
        rig = running(Terms())
        rig.submit(LONG, terms=URGENT)
        rig.step(lambda now: replace(in_control(now), mode=ModeKind.OTHER))
        assert rig.states() == [S.EXECUTING, S.QUEUED]

    def test_not_while_the_queue_stands(self) -> None:
        rig = running(Terms())
        rig.submit(LONG, terms=URGENT)
        rig.tasks.pause(R.OPERATOR, actor=BY, now=rig.now)
        rig.steps(in_control, seconds=3.0)
        assert rig.states() == [S.PAUSED, S.QUEUED]


class TestAfterwards:
    def test_several_resume_by_their_own_rank_and_before_what_is_less_urgent(self) -> None:
        rig = running(Terms(priority=3))
        rig.submit(Wait(4.0), terms=replace(URGENT, priority=6))
        rig.steps(in_control, seconds=REST + 2 * TICK)
        rig.submit(Wait(4.0), terms=replace(URGENT, priority=8))
        rig.submit(LONG, priority=2)
        rig.submit(Wait(1.0), priority=4)
        rig.steps(in_control, seconds=1.0)
        assert rig.states()[:3] == [S.PAUSED, S.PAUSED, S.EXECUTING]
        rig.story()
        rig.steps(in_control, seconds=10.0)
        active = [task_id for task_id, new, _ in rig.story() if new is S.STARTING]
        assert active == [2, 5, 1]
        assert rig.states() == [S.EXECUTING, S.COMPLETED, S.COMPLETED, S.QUEUED, S.COMPLETED]

    def test_a_wait_is_as_long_as_without(self) -> None:
        rig = Rig()
        rig.submit(Wait(5.0))
        rig.step(idle)
        rig.steps(in_control, seconds=3.0)
        rig.submit(Wait(2.0), terms=URGENT)
        rig.steps(in_control, seconds=10.0)
        assert rig.states() == [S.COMPLETED, S.COMPLETED]
        assert rig.task(1).progress.execution_time == pytest.approx(5.0, abs=0.3)

    def test_a_held_task_aside_blocks_what_waits(self) -> None:
        rig = running(Terms())
        rig.submit(LONG, terms=URGENT)
        rig.step(in_control)
        third = rig.submit(LONG)
        rig.task(1)
        rig.registry.change(rig.task(1).id, S.HELD, reason=R.LATE, actor="server", now=rig.now)
        rig.cancel(2)
        rig.steps(in_control, seconds=3.0)
        assert rig.states() == [S.HELD, S.CANCELLED, S.QUEUED]
        assert wait_reason(rig.tasks, third) is R.HELD_AHEAD

    def test_a_held_task_aside_blocks_who_is_marked_too(self) -> None:
        rig = running(Terms())
        rig.submit(LONG, terms=URGENT)
        rig.step(in_control)
        rig.tasks.hold(R.FRAME_RESET, now=rig.now)
        seen = in_control(rig.now)
        rig.tasks.releases.release(
            rig.task(1), again=True, may_continue=True, seen=seen, actor=BY, now=rig.now
        )
        rig.submit(LONG, terms=replace(URGENT, priority=9))
        rig.steps(in_control, seconds=4.0)
        assert rig.states() == [S.EXECUTING, S.HELD, S.QUEUED]

    def test_an_interrupted_one_is_as_urgent_as_who_waits_for_it(self) -> None:
        rig = running(Terms(priority=0))
        rig.submit(LONG, terms=URGENT)
        rig.step(in_control)
        rig.submit(LONG, priority=5)
        rig.submit(terms=Terms(priority=9, after=1))
        rig.cancel(2)
        rig.steps(in_control, seconds=1.0)
        assert rig.states() == [S.EXECUTING, S.CANCELLED, S.QUEUED, S.BLOCKED]


def end_of(goal: Goal, start: Pose) -> Pose:
    match goal:
        case Move(distance=distance):
            north = start.north + distance * cos(start.yaw)
            return Pose(north, start.east + distance * sin(start.yaw), start.yaw)
        case Rotate(angle=angle):
            return Pose(start.north, start.east, wrap(start.yaw + angle))
    raise AssertionError(goal)


class TestTheExactRemainder:
    """A rover that obeys exactly shows where the plan leads."""

    @pytest.mark.parametrize(
        "goal", [Move(5.0), Move(-5.0), Rotate(pi), Rotate(-radians(540))], ids=str
    )
    @pytest.mark.parametrize(
        "others",
        [
            [Move(3.0)],
            [Move(-4.0)],
            [Rotate(pi / 2), Move(3.0)],
            [Rotate(-2.5), Move(-2.0)],
            [Rotate(pi)],
            [Drive(0.3, 0.5, 4.0)],
        ],
        ids=str,
    )
    def test_it_ends_where_it_would_have_ended(self, goal: Goal, others: list[Goal]) -> None:
        start = Pose(3.0, -2.0, radians(70))
        rig, rover = Rig(), Rover(start)
        rig.submit(goal)
        run(rig, rover, seconds=3.0)
        done = rig.task(1).progress.done
        assert 0.2 < done < 4.9
        for other in others:
            rig.submit(other, terms=URGENT)
        run_until(rig, rover, lambda: rig.state(2) is S.EXECUTING)
        assert rig.task(1).progress.done == pytest.approx(done, abs=0.1)
        run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)
        assert set(rig.states()) == {S.COMPLETED}
        end = end_of(goal, start)
        assert hypot(rover.pose.north - end.north, rover.pose.east - end.east) < 0.05
        assert abs(wrap(rover.pose.yaw - end.yaw)) < radians(2.0)

    def test_also_when_it_is_interrupted_again_on_its_way_back(self) -> None:
        rig, rover = Rig(), Rover()
        rig.submit(Move(5.0))
        run(rig, rover, seconds=4.0)
        rig.submit(Rotate(pi / 2), terms=URGENT)
        rig.submit(Move(4.0), terms=URGENT)
        run_until(rig, rover, lambda: rig.states()[1:] == [S.COMPLETED, S.COMPLETED])
        run(rig, rover, seconds=REST + 1.0)
        assert rig.state(1) is S.EXECUTING
        rig.submit(Drive(-0.4, 0.3, 3.0), terms=URGENT)
        run_until(rig, rover, lambda: rig.states() == [S.COMPLETED] * 4)
        assert hypot(rover.pose.north - 5.0, rover.pose.east) < 0.05
