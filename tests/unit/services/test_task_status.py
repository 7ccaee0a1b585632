from math import inf

from mav_tasks.services.task_status import BURST, TaskStatusSender


def sender_of(rate: float, woken: list[float] | None = None) -> TaskStatusSender:
    """Return a sender that writes down when it is to be called."""
    return TaskStatusSender(rate=rate, wake=([] if woken is None else woken).append, now=0.0)


def test_nothing_is_due_before_something_changes() -> None:
    sender = sender_of(50.0)
    assert (sender.next_deadline(), sender.due({1: 1}, now=0.0)) == (inf, [])


def test_changes_are_told_once_and_in_order() -> None:
    sender = sender_of(50.0)
    for task_id in (3, 1, 3, 2, 1):
        sender.changed(task_id)
    assert sender.due({}, now=0.0) == [3, 1, 2]
    assert (sender.due({}, now=0.1), sender.next_deadline()) == ([], inf)


def test_too_many_at_once_are_told_later_and_none_is_lost() -> None:
    sender = sender_of(50.0)
    for task_id in range(100):
        sender.changed(task_id)
    told = sender.due({}, now=0.0)
    assert told == list(range(BURST))
    now = 0.0
    while (due := sender.next_deadline()) < inf:
        assert due > now, "a deadline handled must be over"
        now = due
        told += sender.due({}, now=now)
    assert told == list(range(100))
    assert now == (100 - BURST) / 50.0 or abs(now - (100 - BURST) / 50.0) < 0.05


def test_a_change_while_it_waits_is_told_once() -> None:
    sender = sender_of(1.0)
    for task_id in range(BURST + 1):
        sender.changed(task_id)
    sender.due({}, now=0.0)
    sender.changed(BURST)
    assert sender.due({}, now=1.0) == [BURST]
    assert sender.next_deadline() == inf


def test_a_stream_reports_active_tasks_at_its_interval() -> None:
    sender = sender_of(50.0)
    sender.set_interval(1, 0.5, now=1.0)
    told = []
    for step in range(20):
        now = 1.0 + 0.125 * step
        if sender.due({1: 7}, now=now):
            told.append(now)
    assert told == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert (sender.interval(1), sender.next_deadline()) == (0.5, 3.5)


def test_a_late_wake_up_makes_no_burst() -> None:
    sender = sender_of(50.0)
    sender.set_interval(1, 0.5, now=0.0)
    assert [sender.due({1: 7}, now=now) for now in (0.0, 10.0, 10.0, 10.1)] == [[7], [7], [7], []]


def test_a_task_that_changed_is_not_told_twice_by_the_stream() -> None:
    sender = sender_of(50.0)
    sender.set_interval(1, 1.0, now=0.0)
    sender.set_interval(2, 1.0, now=0.0)
    sender.changed(7)
    assert sender.due({1: 7, 2: 8}, now=0.0) == [7, 8]


def test_a_stream_can_be_ended() -> None:
    sender = sender_of(50.0)
    sender.set_interval(1, 1.0, now=0.0)
    sender.set_interval(1, None, now=0.0)
    assert (sender.due({1: 7}, now=5.0), sender.next_deadline()) == ([], inf)


def test_a_stream_is_of_one_vehicle() -> None:
    sender = sender_of(50.0)
    sender.set_interval(2, 1.0, now=0.0)
    assert sender.due({1: 7, 2: 8}, now=0.0) == [8]
    assert (sender.interval(1), sender.interval(2)) == (None, 1.0)


def test_it_says_when_it_is_to_be_called() -> None:
    woken: list[float] = []
    sender = sender_of(1.0, woken)
    sender.set_interval(1, 0.5, now=2.0)
    for task_id in range(BURST + 1):
        sender.changed(task_id)
    sender.due({}, now=2.0)
    sender.changed(BURST + 1)
    assert woken == [2.0, *[0.0] * (BURST + 1), 3.0], "the last one waits for its turn"
