"""The order of waiting tasks."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.tasks.queue import Entry, Rank, TaskQueue, rank_of
from mav_tasks.tasks.task import TaskId

AGING = 60.0


def rank(priority: int, came_at: float, task_id: int = 1, *, aging: float = AGING) -> Rank:
    return rank_of(priority, came_at=came_at, task_id=TaskId(task_id), aging=aging)


def entry(each: Rank, *, priority: int = 5, is_preemptive: bool = False) -> Entry:
    return Entry(TaskId(int(each.task_id)), each, priority, is_preemptive)


def queue_of(*ranks: Rank) -> TaskQueue:
    queue = TaskQueue()
    for each in ranks:
        queue.put(entry(each))
    return queue


def ids(*numbers: int) -> list[TaskId]:
    return [TaskId(number) for number in numbers]


def test_a_higher_priority_runs_first_and_equals_in_order_of_arrival() -> None:
    priorities = (5, 10, 0, 5, 10)
    queue = queue_of(*(rank(p, 0.0, n) for n, p in enumerate(priorities, 1)))
    assert queue.in_order() == [2, 5, 1, 4, 3]
    assert queue.first() == 2


def test_a_minute_of_waiting_counts_as_one_priority() -> None:
    assert rank(5, 0.0, 1) < rank(6, 60.1, 2)
    assert rank(6, 59.9, 2) < rank(5, 0.0, 1)


def test_nothing_ages_past_the_highest_priority() -> None:
    assert rank(10, 1e6, 2) < rank(9, 0.0, 1)


def test_without_aging_nothing_overtakes() -> None:
    assert rank(6, 1e6, 2, aging=0) < rank(5, 0.0, 1, aging=0)


@given(st.lists(st.tuples(st.integers(0, 10), st.floats(0, 1e4)), min_size=2, max_size=30))
def test_within_a_priority_first_come_is_first_served(came: list[tuple[int, float]]) -> None:
    ranks = [rank(p, at, n) for n, (p, at) in enumerate(came, 1)]
    order = queue_of(*ranks).in_order()
    for before, after in pairwise(order):
        one, other = came[before - 1], came[after - 1]
        assert one[0] != other[0] or (one[1], before) < (other[1], after)


def test_a_position_is_how_many_run_before() -> None:
    queue = queue_of(rank(5, 0, 1), rank(10, 0, 2), rank(0, 0, 3))
    assert [queue.position(task_id) for task_id in ids(1, 2, 3, 4)] == [1, 0, 2, None]


def test_what_was_taken_out_leaves_the_others_in_order() -> None:
    queue = queue_of(rank(5, 0, 1), rank(5, 0, 2), rank(8, 0, 3))
    queue.discard(TaskId(1))
    queue.discard(TaskId(9))
    assert (queue.in_order(), len(queue)) == ([3, 2], 2)
    assert TaskId(1) not in queue


def test_what_is_put_in_again_has_its_new_place_only() -> None:
    queue = queue_of(rank(5, 0, 1), rank(6, 0, 2))
    queue.put(entry(rank(7, 0, 1)))
    assert (queue.in_order(), len(queue)) == ([1, 2], 2)


def test_those_that_may_interrupt_are_found_by_their_own_priority() -> None:
    queue = TaskQueue()
    assert queue.interrupters() == []
    queue.put(entry(rank(9, 0, 1), priority=4))  # as urgent as one that waits for it
    assert queue.interrupters() == [1]
    queue.put(entry(rank(1, 0, 2), priority=1, is_preemptive=True))
    queue.put(entry(rank(2, 600, 3), priority=2, is_preemptive=True))  # behind the aged one
    assert (queue.first(), queue.interrupters()) == (1, [3, 1])
    queue.put(entry(rank(5, 900, 4), priority=5))
    assert (queue.first(), queue.interrupters()) == (1, [3, 4])
    queue.put(entry(rank(2, 0, 3), priority=2))
    assert queue.interrupters() == [2, 4]
    queue.discard(TaskId(2))
    assert queue.interrupters() == [4]


@pytest.mark.parametrize(("first", "count", "page"), [(0, 2, [1, 2]), (2, 9, [3]), (7, 2, [])])
def test_a_page_is_a_part_of_the_order(first: int, count: int, page: list[int]) -> None:
    queue = queue_of(*(rank(5, n, n) for n in (1, 2, 3)))
    assert queue.page(first, count) == page


def test_many_at_once_are_the_same_as_one_by_one() -> None:
    ranks = [rank(n % 11, n % 7, n) for n in range(1, 200)]
    at_once = TaskQueue()
    one_by_one = TaskQueue()
    entries = [
        entry(r, priority=int(r.task_id) % 11, is_preemptive=r.task_id % 3 == 0) for r in ranks
    ]
    at_once.put_all(entries)
    for each in entries:
        one_by_one.put(each)
    assert at_once.in_order() == one_by_one.in_order()
    assert at_once.interrupters() == one_by_one.interrupters()


def test_an_empty_queue_has_no_first() -> None:
    assert (TaskQueue().first(), repr(TaskQueue())) == (None, "TaskQueue(0, next=None)")
