"""The order of waiting tasks."""

from operator import itemgetter

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.tasks.queue import Rank, TaskQueue, rank_of
from mav_tasks.tasks.task import TaskId, Terms

AGING = 60.0
Entry = tuple[TaskId, Rank, Terms]


def rank(priority: int, came_at: float, task_id: int = 1, *, aging: float = AGING) -> Rank:
    return rank_of(Terms(priority), came_at=came_at, task_id=TaskId(task_id), aging=aging)


def entry(each: Rank, *, priority: int = 5, is_preemptive: bool = False) -> Entry:
    terms = Terms(priority, is_preemptive=is_preemptive)
    return TaskId(int(each.task_id)), each, terms


def test_more_urgent_first_a_minute_counts_as_one_priority_and_equals_come_in_order() -> None:
    for one, other in (
        (rank(10, 0.0, 2), rank(5, 0.0, 1)),
        (rank(5, 0.0, 1), rank(5, 0.0, 2)),
        (rank(5, 1.0, 9), rank(5, 2.0, 1)),
        (rank(5, 0.0, 1), rank(6, 60.1, 2)),
        (rank(6, 59.9, 2), rank(5, 0.0, 1)),
        (rank(10, 1e6, 2), rank(9, 0.0, 1)),  # nothing ages past the highest priority
        (rank(6, 1e6, 2, aging=0), rank(5, 0.0, 1, aging=0)),
    ):
        assert one < other, (one, other)


@given(
    st.lists(
        st.tuples(st.integers(1, 9), st.integers(0, 10), st.floats(0, 1e3), st.booleans()),
        max_size=30,
    )
)
def test_whatever_comes_and_goes_it_is_sorted_and_knows_who_may_interrupt(
    changes: list[tuple[int, int, float, bool]],
) -> None:
    queue, known = TaskQueue(), dict[int, Entry]()
    for number, (task_id, priority, at, is_marked) in enumerate(changes):
        if number % 4 == 3:
            queue.discard(TaskId(task_id))
            known.pop(task_id, None)
        else:  # again or anew
            known[task_id] = entry(
                rank(priority, at, task_id), priority=priority, is_preemptive=is_marked
            )
            queue.put(*known[task_id])
    at_once = TaskQueue()
    at_once.put_all(list(known.values()))
    entries = sorted(known.values(), key=itemgetter(1))
    order = [task_id for task_id, _, _ in entries]
    for found in (queue, at_once):
        assert (found.in_order(), len(found)) == (order, len(order))
        assert found.first() == (order[0] if order else None)
        assert [found.position(TaskId(n)) for n in range(1, 10)] == [
            order.index(TaskId(n)) if n in known else None for n in range(1, 10)
        ]
        assert found.page(1, 2) == order[1:3]
        assert [n for n in range(1, 10) if TaskId(n) in found] == sorted(known)
        marked = [each for each in entries if each[2].is_preemptive]
        firsts = [  # by their own priority, of those that are marked and of all
            min(several, key=lambda each: (-each[2].priority, each[1]))[0]
            for several in (marked, entries)
            if several
        ]
        assert found.interrupters() == firsts


def test_a_rank_that_was_inherited_does_not_interrupt() -> None:
    queue = TaskQueue()
    waited_for = entry(rank(9, 0, 1), priority=4)
    queue.put_all([waited_for, entry(rank(5, 900, 4), priority=5)])
    assert (queue.first(), queue.interrupters()) == (1, [4])
