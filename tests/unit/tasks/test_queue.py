import pytest

from mav_tasks.errors import Rejection
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.queue import TaskQueue
from mav_tasks.tasks.task import Task
from tests.unit.tasks.samples import draft


def tasks(*priorities: int) -> list[Task]:
    """Tasks with ids 1, 2, … of these priorities."""
    book = TaskBook()
    return [book.submit(draft(priority=priority), now=0.0) for priority in priorities]


def queue_of(waiting: list[Task], *, capacity: int = 10) -> TaskQueue:
    queue = TaskQueue(capacity)
    for task in waiting:
        queue.add(task)
    return queue


def test_a_higher_priority_runs_first_and_equals_in_order_of_arrival() -> None:
    queue = queue_of(tasks(5, 10, 0, 5, 10))
    assert queue.in_order() == [2, 5, 1, 4, 3]
    assert queue.first() == 2


def test_the_order_is_by_arrival_of_the_task_not_by_when_it_was_put_in() -> None:
    assert queue_of(list(reversed(tasks(5, 5, 5)))).in_order() == [1, 2, 3]


def test_a_position_is_how_many_run_before() -> None:
    waiting = tasks(5, 10, 0)
    queue = queue_of(waiting)
    assert [queue.position(task) for task in waiting] == [1, 0, 2]


def test_what_does_not_wait_here_has_no_position() -> None:
    one, other = tasks(5, 5)
    queue = queue_of([one])
    assert queue.position(other) is None
    with pytest.raises(KeyError):
        queue.remove(other)


def test_what_was_taken_out_leaves_the_others_in_order() -> None:
    waiting = tasks(5, 5, 8)
    queue = queue_of(waiting)
    queue.remove(waiting[0])
    assert (queue.in_order(), len(queue)) == ([3, 2], 2)


def test_a_full_queue_refuses_and_keeps_what_it_has() -> None:
    waiting = tasks(5, 5, 5)
    queue = queue_of(waiting[:2], capacity=2)
    with pytest.raises(Rejection, match="queue full: 2 tasks wait") as refusal:
        queue.add(waiting[2])
    assert (refusal.value.reason, queue.in_order()) == (TaskReason.QUEUE_FULL, [1, 2])


def test_an_empty_queue_has_no_first() -> None:
    assert (TaskQueue(1).first(), repr(TaskQueue(1))) == (None, "TaskQueue(0/1, next=None)")
