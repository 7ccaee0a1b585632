"""Tasks are what their events add up to."""

from dataclasses import replace

import pytest

from mav_tasks.errors import IllegalTransition
from mav_tasks.tasks import registry as book_module
from mav_tasks.tasks.events import TaskChanged, TaskSubmitted, TaskWithdrawn
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import MAX_TASK_ID, Marks, Progress, Submitter, Task, TaskId, Terms
from tests.unit.tasks.samples import ORIGIN, SOMEBODY, TASK_MOVE, draft

S, R = TaskState, TaskReason


def change(
    registry: TaskRegistry,
    task_id: int,
    new: TaskState,
    *,
    now: float = 2.0,
    reason: TaskReason = R.NONE,
) -> Task:
    return registry.change(TaskId(task_id), new, reason=reason, actor="somebody", now=now)


def finish(registry: TaskRegistry, task_id: int) -> None:
    change(registry, task_id, S.KILLED, reason=R.STOP)


def test_a_submission_becomes_a_queued_task() -> None:
    registry = TaskRegistry()
    task = registry.submit(draft(priority=8, nonce=77), now=1.5)
    assert task == Task(
        id=TaskId(1),
        vehicle=1,
        command=54000,
        goal=draft().goal,
        submitter=SOMEBODY,
        marks=Marks(77),
        submitted_at=1.5,
        terms=Terms(priority=8),
        state=S.QUEUED,
        reason=R.NONE,
        version=1,
        progress=Progress(),
    )
    assert registry.take_events() == [TaskSubmitted(task, 1.5)]


def test_ids_are_never_used_again() -> None:
    registry = TaskRegistry(next_id=7)
    ids = [registry.submit(draft(), now=0.0).id]
    registry.withdraw(ids[0], now=0.0)
    ids.append(registry.submit(draft(), now=0.0).id)
    finish(registry, ids[1])
    ids.append(registry.submit(draft(), now=0.0).id)
    assert ids == [7, 8, 9]


def test_every_change_is_an_event_and_a_version() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)
    registry.take_events()
    task = change(registry, 1, S.STARTING)
    assert (task.state, task.version) == (S.STARTING, 2)
    assert registry.take_events() == [
        TaskChanged(TaskId(1), 1, 2, S.QUEUED, S.STARTING, R.NONE, "somebody", 2.0, Progress())
    ]
    assert registry.take_events() == []


def test_a_change_can_bring_progress() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)
    progress = Progress(ORIGIN, 0.5, 3.0)
    registry.change(
        TaskId(1), S.STARTING, reason=R.NONE, actor="server", now=2.0, progress=progress
    )
    assert registry[TaskId(1)].progress == progress


def test_an_illegal_change_leaves_everything_as_it_was() -> None:
    registry = TaskRegistry()
    before = registry.submit(draft(), now=1.0)
    with pytest.raises(IllegalTransition):
        change(registry, 1, S.COMPLETED)
    assert (registry[TaskId(1)], registry.recorded) == (before, 1)


def test_live_progress_is_no_event() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)
    registry.note_progress(TaskId(1), Progress(ORIGIN, 1.0, 2.0))
    assert (registry[TaskId(1)].progress.done, registry[TaskId(1)].version, registry.recorded) == (
        1.0,
        1,
        1,
    )


def test_events_are_numbered_from_1_whether_taken_or_not() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)
    registry.take_events()
    registry.submit(draft(), now=1.0)
    change(registry, 1, S.STARTING)
    assert (registry.recorded, len(registry.take_events())) == (3, 2)


def test_a_task_is_durable_when_its_last_event_is() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)  # event 1
    registry.submit(draft(), now=1.0)  # event 2
    registry.durable = 1
    assert [registry.is_durable(TaskId(n)) for n in (1, 2)] == [True, False]
    change(registry, 1, S.STARTING)  # event 3
    registry.durable = 2
    assert [registry.is_durable(TaskId(n)) for n in (1, 2)] == [False, True]
    registry.durable = 3
    assert registry.is_durable(TaskId(1))


def test_a_withdrawn_submission_never_was_a_task() -> None:
    registry = TaskRegistry()
    registry.submit(draft(), now=1.0)
    registry.take_events()
    registry.withdraw(TaskId(1), now=1.4)
    assert (registry.get(1), registry.all()) == (None, ())
    assert registry.take_events() == [TaskWithdrawn(TaskId(1), 1, 1.4)]


def test_tasks_are_given_oldest_first_and_counted_by_vehicle_and_state() -> None:
    registry = TaskRegistry()
    for vehicle in (1, 2, 1):
        registry.submit(draft(vehicle=vehicle), now=0.0)
    registry.change(TaskId(3), TaskState.STARTING, reason=TaskReason.NONE, actor="x", now=1.0)
    assert [task.id for task in registry.all()] == [1, 2, 3]
    counts = [0] * len(TaskState)
    counts[TaskState.QUEUED] = counts[TaskState.STARTING] = 1
    assert (registry.counts(1), sum(registry.counts(2)), sum(registry.counts(9))) == (counts, 1, 0)


def test_after_the_last_id_those_come_again_that_no_task_has() -> None:
    registry = TaskRegistry(next_id=2)
    kept = registry.submit(draft(), now=0.0)
    again = TaskRegistry()
    again.restore([kept], next_id=MAX_TASK_ID)
    assert [again.submit(draft(), now=0.0).id for _ in range(3)] == [MAX_TASK_ID, 1, 3]


def test_the_oldest_finished_are_forgotten_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(book_module, "KEPT_FINISHED", 2)
    registry = TaskRegistry()
    for _ in range(5):
        registry.submit(draft(), now=0.0)
    for task_id in (4, 2, 5):
        finish(registry, task_id)
    assert [task.id for task in registry.all()] == [1, 2, 3, 5]
    assert registry.get(4) is None


class TestTheLatest:
    """What COMMAND_CANCEL means: a client's latest task of a command that is not over."""

    def test_is_by_client_command_and_vehicle(self) -> None:
        registry = TaskRegistry()
        other = replace(SOMEBODY, endpoint="127.0.0.1:50001")
        wishes = [draft(), draft(), draft(vehicle=2), replace(draft(), submitter=other)]
        for wish in [*wishes, replace(draft(), command=16)]:
            registry.submit(wish, now=0.0)

        def latest(submitter: Submitter, command: int, vehicle: int) -> int | None:
            task = registry.latest(submitter, command, vehicle=vehicle)
            return None if task is None else task.id

        assert latest(SOMEBODY, TASK_MOVE, 1) == 2
        assert latest(SOMEBODY, TASK_MOVE, 2) == 3
        assert latest(other, TASK_MOVE, 1) == 4
        assert latest(SOMEBODY, 16, 1) == 5
        assert latest(other, 16, 1) is None

    def test_is_the_one_before_once_it_is_over_or_withdrawn_also_after_a_restart(self) -> None:
        registry = TaskRegistry()
        for _ in range(4):
            registry.submit(draft(), now=0.0)
        finish(registry, 4)
        registry.withdraw(TaskId(3), now=0.0)
        again = TaskRegistry()
        again.restore(registry.all(), next_id=5)
        for each in (registry, again):
            assert each.latest(SOMEBODY, TASK_MOVE, vehicle=1) == each[TaskId(2)]
            finish(each, 2)
            finish(each, 1)
            assert each.latest(SOMEBODY, TASK_MOVE, vehicle=1) is None


def test_finished_tasks_are_listed_by_vehicle_the_newest_first_also_after_a_restart() -> None:
    registry = TaskRegistry()
    tasks = [registry.submit(draft(vehicle=1 + number % 2), now=0.0) for number in range(6)]
    for at, task in enumerate(reversed(tasks)):  # the last one submitted ends first
        registry.change(task.id, S.CANCELLED, reason=R.CANCELLED, actor="x", now=float(at))
    assert registry.finished(1, 0, 16) == [1, 3, 5]
    assert registry.finished(2, 0, 2) == [2, 4]
    assert registry.finished(2, 2, 2) == [6]
    assert registry.finished(2, 3, 2) == registry.finished(9, 0, 2) == []
    after = TaskRegistry()
    after.restore(registry.all(), next_id=7)
    assert after.finished(1, 0, 16) == [1, 3, 5]
