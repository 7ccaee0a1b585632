"""Tasks that have not begun: times, dependencies over vehicles, urgency, bounds."""

from dataclasses import replace

import pytest

from mav_tasks.errors import Rejection
from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Draft, Task, TaskId, Terms
from tests.unit.tasks.samples import SOMEBODY

S, R = TaskState, TaskReason
DAY = 86_400.0


class Rig:
    """A room, and a registry that is durable at once."""

    def __init__(self, *, queueing: Queueing | None = None, is_shared: bool = False) -> None:
        self.registry = TaskRegistry()
        self.room = PendingTasks(self.registry, Settings(queueing=queueing or Queueing()))
        if is_shared:
            self.room.share()
        self.now = 100.0

    def submit(self, *, vehicle: int = 1, **terms: object) -> TaskId:
        draft = Draft(vehicle, 54000, Move(1.0), SOMEBODY, replace(Terms(), **terms))  # type: ignore[arg-type]
        return self.room.submit(draft, now=self.now).id

    def state(self, task_id: int) -> tuple[TaskState, TaskReason]:
        task = self.registry[TaskId(task_id)]
        return task.state, task.reason

    def pass_to(self, now: float) -> None:
        self.now = now
        self.room.handle_deadline(now=now)

    def finish(self, task_id: TaskId, state: TaskState) -> None:
        """Let a ready task run to its end."""
        self.room.leave(self.registry[task_id])
        for new in (S.STARTING, S.EXECUTING, state):
            self.registry.change(task_id, new, reason=R.NONE, actor="server", now=self.now)
        self.room.ended(task_id, now=self.now)

    def modify(self, task_id: TaskId, **terms: object) -> None:
        task = self.registry[task_id]
        changed = replace(task.terms, **terms)  # type: ignore[arg-type]
        self.room.modify(task, changed, actor="client", now=self.now)

    def order(self, vehicle: int = 1) -> list[TaskId]:
        return self.room.queue(vehicle).in_order()


def refusal(rig: Rig, **terms: object) -> TaskReason:
    with pytest.raises(Rejection) as refused:
        rig.submit(**terms)  # type: ignore[arg-type]
    return TaskReason(refused.value.reason)


class TestTimes:
    def test_a_start_time_is_waited_for(self) -> None:
        rig = Rig()
        task = rig.submit(start_at=105.0)
        assert rig.state(task)[0] is S.SCHEDULED
        assert rig.room.times.next_at == 105.0
        rig.pass_to(104.9)
        assert rig.state(task)[0] is S.SCHEDULED
        rig.pass_to(105.0)
        assert (rig.state(task)[0], rig.room.take_woken()) == (S.QUEUED, {1})

    def test_a_step_of_the_wall_clock_moves_utc_starts_and_nothing_else(self) -> None:
        rig = Rig()
        rig.room.set_wall_offset(1000.0, now=rig.now)
        delayed, utc = rig.submit(start_at=105.0), rig.submit(start_utc=1110)
        rig.room.set_wall_offset(1000.0 - DAY, now=rig.now)
        rig.pass_to(106.0)
        assert [rig.state(t)[0] for t in (delayed, utc)] == [S.QUEUED, S.SCHEDULED]
        rig.room.set_wall_offset(1000.0 + DAY, now=rig.now)
        assert rig.state(utc)[0] is S.QUEUED

    def test_what_was_scheduled_comes_when_its_time_comes(self) -> None:
        rig = Rig()
        early = rig.submit(start_at=200.0)
        rig.pass_to(190.0)
        later = rig.submit()
        rig.pass_to(200.0)
        assert rig.order() == [later, early]

    def test_a_deadline_ends_it_and_fails_what_waits_for_it(self) -> None:
        rig = Rig()
        task = rig.submit(deadline=103.0)
        waiting = rig.submit(vehicle=2, after=task)
        last = rig.submit(vehicle=3, after=waiting)
        rig.pass_to(103.0)
        assert rig.state(task) == (S.EXPIRED, R.DEADLINE)
        assert [rig.state(t) for t in (waiting, last)] == [(S.FAILED, R.DEPENDENCY_FAILED)] * 2
        assert rig.room.times.next_at == float("inf")

    def test_a_deadline_that_was_moved_counts_no_more(self) -> None:
        rig = Rig()
        task = rig.submit(deadline=103.0)
        rig.modify(task, deadline=None)
        rig.pass_to(110.0)
        assert rig.state(task)[0] is S.QUEUED


class TestDependencies:
    def test_over_vehicles_one_runs_after_the_other(self) -> None:
        rig = Rig()
        first = rig.submit()
        second = rig.submit(vehicle=2, after=first)
        assert (rig.state(second)[0], rig.order(2)) == (S.BLOCKED, [])
        rig.room.take_woken()
        rig.finish(first, S.COMPLETED)
        assert (rig.state(second)[0], rig.order(2)) == (S.QUEUED, [second])
        assert 2 in rig.room.take_woken()

    def test_what_is_over_is_waited_for_no_more_or_never(self) -> None:
        rig = Rig()
        done, failed = rig.submit(), rig.submit()
        rig.finish(done, S.COMPLETED)
        rig.finish(failed, S.FAILED)
        assert rig.state(rig.submit(after=done))[0] is S.QUEUED
        assert refusal(rig, after=failed) is R.DEPENDENCY_FAILED
        assert refusal(rig, after=999) is R.UNKNOWN_DEPENDENCY

    def test_a_circle_is_refused_and_changes_nothing(self) -> None:
        rig = Rig()
        first = rig.submit()
        second = rig.submit(after=first)
        third = rig.submit(after=second)
        before = rig.registry[first]
        with pytest.raises(Rejection) as refused:
            rig.modify(first, after=third)
        assert refused.value.reason == R.CYCLE
        assert rig.registry[first] == before

    def test_cleared_together_none_has_failed(self) -> None:
        rig = Rig()
        first = rig.submit()
        second = rig.submit(after=first)
        rig.room.clear(1, R.CLEARED, actor="client", now=rig.now)
        assert [rig.state(t) for t in (first, second)] == [(S.CANCELLED, R.CLEARED)] * 2

    def test_what_waits_for_a_withdrawn_one_fails(self) -> None:
        rig = Rig()
        first = rig.submit()
        second = rig.submit(after=first)
        third = rig.submit(after=second, vehicle=2)
        rig.room.withdraw(rig.registry[first], now=rig.now)
        assert [rig.state(t) for t in (second, third)] == [(S.FAILED, R.DEPENDENCY_FAILED)] * 2


class TestDependenciesElsewhere:
    """Tasks of a gateway that run after those of other gateways' vehicles: 500 and above."""

    @staticmethod
    def behind(rig: Rig, state: TaskState = S.EXECUTING, **terms: object) -> TaskId:
        """Submit a task that runs after one elsewhere, which is in this state."""
        with rig.room.told({500: state}, now=rig.now):
            return rig.submit(after=500, **terms)  # type: ignore[arg-type]

    @staticmethod
    def tell(rig: Rig, state: TaskState | None) -> None:
        with rig.room.told({500: state}, now=rig.now):
            pass

    def test_only_the_store_of_a_fleet_knows_them(self) -> None:
        assert not Rig().room.is_in_question(500)
        rig = Rig(is_shared=True)
        assert rig.room.is_in_question(500)
        assert not rig.room.is_in_question(rig.submit())
        self.behind(rig)
        assert not rig.room.is_in_question(500)  # one that waits for it shows that it exists

    def test_one_runs_after_the_other(self) -> None:
        rig = Rig(is_shared=True)
        task = self.behind(rig)
        assert (rig.state(task)[0], rig.room.expected) == (S.BLOCKED, {500})
        self.tell(rig, S.HELD)
        assert (rig.state(task)[0], rig.room.take_woken()) == (S.BLOCKED, set())
        self.tell(rig, S.COMPLETED)
        assert (rig.state(task)[0], rig.order()) == (S.QUEUED, [task])
        assert (rig.room.expected, rig.room.take_woken()) == (set(), {1})

    @pytest.mark.parametrize("state", [S.FAILED, S.CANCELLED, S.KILLED, S.EXPIRED, None])
    def test_the_failure_or_withdrawal_of_one_fails_all_that_follow(
        self, state: TaskState | None
    ) -> None:
        rig = Rig(is_shared=True)
        task = self.behind(rig)
        last = rig.submit(after=task, vehicle=2)
        self.tell(rig, state)
        assert [rig.state(each) for each in (task, last)] == [(S.FAILED, R.DEPENDENCY_FAILED)] * 2
        assert rig.room.expected == set()

    def test_what_is_over_is_waited_for_no_more_or_never(self) -> None:
        rig = Rig(is_shared=True)
        assert rig.state(self.behind(rig, S.COMPLETED))[0] is S.QUEUED
        for state, reason in ((S.KILLED, R.DEPENDENCY_FAILED), (None, R.UNKNOWN_DEPENDENCY)):
            with rig.room.told({500: state}, now=rig.now):
                assert refusal(rig, after=500) is reason
        assert refusal(rig, after=500) is R.UNKNOWN_DEPENDENCY  # nobody has been asked
        assert rig.room.expected == set()

    def test_a_scheduled_one_remembers_that_it_need_not_wait(self) -> None:
        rig = Rig(is_shared=True)
        early, late = self.behind(rig, start_at=105.0), self.behind(rig, start_at=110.0)
        rig.pass_to(106.0)
        self.tell(rig, S.COMPLETED)
        assert [rig.state(each)[0] for each in (early, late)] == [S.QUEUED, S.SCHEDULED]
        rig.pass_to(110.0)
        assert rig.state(late)[0] is S.QUEUED

    def test_what_leaves_is_asked_about_no_more(self) -> None:
        rig = Rig(is_shared=True)
        task = self.behind(rig)
        rig.modify(task, after=0)
        assert (rig.state(task)[0], rig.room.expected) == (S.QUEUED, set())

    @pytest.mark.parametrize("state", [S.BLOCKED, S.SCHEDULED, S.QUEUED])
    def test_after_a_takeover_it_waits_unless_it_was_ready(self, state: TaskState) -> None:
        rig = Rig(is_shared=True)
        rig.submit()
        task = replace(
            rig.registry[TaskId(1)],
            state=state,
            terms=Terms(after=500, start_at=300.0 if state is S.SCHEDULED else None),
        )
        again = Rig(is_shared=True)
        again.registry.restore([task], next_id=5)
        again.room.restore([task], now=150.0)
        again.pass_to(300.0)
        is_ready = state is S.QUEUED
        assert again.state(1)[0] is (S.QUEUED if is_ready else S.BLOCKED)
        assert again.room.expected == (set() if is_ready else {500})
        self.tell(again, S.COMPLETED)
        assert again.state(1)[0] is S.QUEUED

    @pytest.mark.parametrize(
        ("state", "then"),
        [
            (S.EXECUTING, (S.BLOCKED, R.NONE)),
            (S.COMPLETED, (S.QUEUED, R.NONE)),
            (S.CANCELLED, (S.FAILED, R.DEPENDENCY_FAILED)),
        ],
    )
    def test_one_that_comes_to_this_gateway_is_no_longer_asked_about(
        self, state: TaskState, then: tuple[TaskState, TaskReason]
    ) -> None:
        rig = Rig(is_shared=True)
        task = self.behind(rig)
        taken = replace(rig.registry[task], id=TaskId(500), vehicle=2, state=state, terms=Terms())
        rig.registry.restore([taken])
        rig.room.restore([taken], now=rig.now)
        assert (rig.state(task), rig.room.expected) == (then, set())

    def test_one_that_leaves_this_gateway_is_asked_about_from_then_on(self) -> None:
        rig = Rig(is_shared=True)
        ahead = rig.submit(vehicle=2, priority=1)
        waits, goes = rig.submit(after=ahead), rig.submit(vehicle=2, after=ahead, priority=9)
        rig.room.forget(2)
        rig.registry.forget(2)
        rig.room.forgotten(now=rig.now)
        assert (rig.state(waits)[0], rig.room.expected) == (S.BLOCKED, {ahead})
        assert rig.registry.get(goes) is None
        with rig.room.told({ahead: S.COMPLETED}, now=rig.now):
            pass
        assert rig.state(waits)[0] is S.QUEUED

    def test_a_waiting_task_is_not_put_behind_what_others_may_change(self) -> None:
        rig = Rig(is_shared=True)
        first = rig.submit()
        behind = self.behind(rig)
        for after, reason in ((501, R.UNKNOWN_DEPENDENCY), (behind, R.CYCLE)):
            with pytest.raises(Rejection) as refused:
                rig.modify(first, after=after)
            assert refused.value.reason == reason
        self.tell(rig, S.COMPLETED)
        rig.modify(first, after=behind)
        assert rig.state(first)[0] is S.BLOCKED

    def test_urgency_goes_with_those_that_leave(self) -> None:
        rig = Rig(is_shared=True)
        needed, other = rig.submit(priority=1), rig.submit(priority=5)
        rig.submit(vehicle=2, after=needed, priority=9)
        assert rig.order() == [needed, other]
        rig.room.forget(2)
        assert rig.order() == [other, needed]


class TestUrgency:
    def test_is_inherited_through_others_and_lost_with_them(self) -> None:
        rig = Rig()
        needed = rig.submit(priority=1)
        usual = rig.submit(priority=5)
        between = rig.submit(priority=0, after=needed)
        immediate = rig.submit(priority=9, after=between)
        assert rig.order() == [needed, usual]
        rig.room.end(rig.registry[immediate], S.CANCELLED, R.CANCELLED, actor="client", now=rig.now)
        assert rig.order() == [usual, needed]

    def test_follows_a_modified_priority(self) -> None:
        rig = Rig()
        needed = rig.submit(priority=1)
        usual = rig.submit(priority=5)
        waiting = rig.submit(priority=1, after=needed)
        assert rig.order() == [usual, needed]
        rig.modify(waiting, priority=10)
        assert rig.order() == [needed, usual]

    def test_of_a_preemptive_one_is_seen(self) -> None:
        rig = Rig()
        task = rig.submit()
        rig.submit(priority=9)
        assert task not in rig.room.queue(1).interrupters()
        rig.modify(task, is_preemptive=True)
        assert task in rig.room.queue(1).interrupters()

    def test_of_what_has_begun_is_inherited_too(self) -> None:
        rig = Rig()
        active, other = rig.submit(priority=0), rig.submit(priority=5)
        rig.room.leave(rig.registry[active])
        rig.submit(priority=9, after=active)
        assert rig.room.rank(rig.registry[active]) < rig.room.rank(rig.registry[other])


class TestBounds:
    def test_a_vehicle_has_a_capacity_of_all_that_wait(self) -> None:
        rig = Rig(queueing=Queueing(capacity=2))
        first = rig.submit(start_at=200.0)
        rig.submit(after=first)
        assert refusal(rig) is R.QUEUE_FULL
        rig.submit(vehicle=2)

    def test_a_client_has_a_quota_over_all_vehicles(self) -> None:
        rig = Rig(queueing=Queueing(quota=2))
        first = rig.submit()
        rig.submit(vehicle=2)
        assert refusal(rig, vehicle=3) is R.QUOTA
        rig.finish(first, S.COMPLETED)
        rig.submit(vehicle=3)


def test_what_is_restored_waits_as_before() -> None:
    rig = Rig()
    needed = rig.submit(priority=2)
    tasks = [rig.submit(), rig.submit(start_at=300.0), rig.submit(after=needed, priority=9)]
    before: list[Task] = list(rig.registry.all())
    again = Rig()
    again.registry.restore(before, next_id=5)
    again.room.restore(before, now=150.0)
    assert again.order() == rig.order() == [needed, tasks[0]]
    assert list(again.registry.all()) == before
    assert again.room.count(1) == 4
    again.pass_to(300.0)
    assert again.state(tasks[1])[0] is S.QUEUED


def test_the_failure_of_what_is_needed_is_not_forgotten_over_a_restart() -> None:
    rig = Rig()
    needed = rig.submit()
    rig.submit(after=needed)
    rig.submit(after=2, vehicle=2)
    # the end of the one was kept, the failures that follow from it were not
    over = replace(rig.registry[needed], state=S.CANCELLED)
    before = [over, *rig.registry.all()[1:]]
    again = Rig()
    again.registry.restore(before, next_id=4)
    again.room.restore(before, now=150.0)
    assert [again.state(t) for t in (2, 3)] == [(S.FAILED, R.DEPENDENCY_FAILED)] * 2
    assert (again.order(1), again.order(2)) == ([], [])


def test_inherited_urgency_is_restored_whatever_the_order_of_ids() -> None:
    rig = Rig()
    first, second, third = rig.submit(priority=10), rig.submit(priority=1), rig.submit(priority=5)
    rig.modify(first, after=second)
    before = rig.registry.all()
    again = Rig()
    again.registry.restore(before, next_id=4)
    again.room.restore(before, now=150.0)
    assert again.order() == rig.order() == [second, third]


class TestAssigning:
    """A waiting task that gets another vehicle."""

    def assign(self, rig: Rig, task_id: TaskId, vehicle: int) -> Task:
        rig.room.assign(rig.registry[task_id], vehicle, choice="why", now=rig.now)
        return rig.registry[task_id]

    def test_it_keeps_its_rank_in_the_queue_of_the_other_vehicle(self) -> None:
        rig = Rig()
        moved = rig.submit(priority=7)
        others = [rig.submit(vehicle=2, priority=priority) for priority in (8, 6)]
        rig.room.take_woken()
        task = self.assign(rig, moved, 2)
        assert (task.vehicle, task.choice, task.version) == (2, "why", 2)
        assert rig.order(2) == [others[0], moved, others[1]]
        assert (rig.order(1), rig.room.count(1), rig.room.count(2)) == ([], 0, 3)
        assert rig.room.take_woken() == {1, 2}
        assert rig.registry.counts(1)[S.QUEUED] == 0
        assert rig.registry.counts(2)[S.QUEUED] == 3
        rig.finish(moved, S.COMPLETED)
        assert rig.room.count(2) == 2

    def test_one_that_is_not_ready_comes_to_the_other_queue_when_it_is(self) -> None:
        rig = Rig()
        first = rig.submit(vehicle=3)
        tasks = [rig.submit(start_at=200.0), rig.submit(after=first)]
        for task in tasks:
            self.assign(rig, task, 2)
        assert rig.order(2) == []
        rig.finish(first, S.COMPLETED)
        rig.pass_to(200.0)
        assert (rig.order(1), rig.order(2)) == ([], [tasks[1], tasks[0]])

    def test_it_is_durable_again_only_when_that_is_stored(self) -> None:
        rig = Rig()
        task = rig.submit()
        rig.registry.durable = rig.registry.recorded
        self.assign(rig, task, 2)
        assert not rig.registry.is_durable(task)
        assert not rig.registry.is_all_durable(1)
        assert not rig.registry.is_all_durable(2)

    def test_a_task_that_has_begun_is_never_assigned(self) -> None:
        rig = Rig()
        task = rig.submit()
        rig.room.leave(rig.registry[task])
        rig.registry.change(task, S.STARTING, reason=R.NONE, actor="server", now=rig.now)
        with pytest.raises(AssertionError):
            rig.registry.assign(task, 2, choice="why", now=rig.now)
