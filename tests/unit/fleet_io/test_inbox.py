"""What waits for the loop: a STOP before the rest, each with its whole age, none too late."""

import select
from math import inf

import pytest

from mav_tasks.fleet.exchange import Arrived
from mav_tasks.fleet.notification import SESSION
from mav_tasks.fleet_io.inbox import LIMIT, Inbox
from mav_tasks.fleet_io.keeper import Trouble


def datagram(payload: bytes, *, first: bool = False, until: float = inf) -> Arrived:
    """Return a datagram that was read at 10 s, after 0.5 s."""
    return Arrived("a", bytes(SESSION), payload, at=10.0, waited=0.5, first=first, until=until)


def taken(inbox: Inbox, most: float = inf, *, now: float = 10.0) -> list[bytes | Trouble]:
    return [
        each.payload if isinstance(each, Arrived) else each for each in inbox.take(most, now=now)
    ]


def is_readable(inbox: Inbox) -> bool:
    fd = inbox.fileno()
    assert fd is not None
    return bool(select.select([fd], [], [], 0)[0])


def test_what_is_first_overtakes_the_rest_and_the_order_is_kept_otherwise() -> None:
    inbox = Inbox()
    for item in (
        datagram(b"1"),
        Trouble("away"),
        datagram(b"stop", first=True),
        datagram(b"2"),
        datagram(b"stop again", first=True),
    ):
        inbox.put(item)
    assert taken(inbox) == [b"stop", b"stop again", b"1", Trouble("away"), b"2"]


def test_it_is_readable_until_all_has_been_taken() -> None:
    inbox = Inbox()
    assert not is_readable(inbox)
    for number in range(3):
        inbox.put(datagram(b"%d" % number))
    assert (is_readable(inbox), taken(inbox, 2)) == (True, [b"0", b"1"])
    assert (is_readable(inbox), taken(inbox, 2)) == (True, [b"2"])
    assert not is_readable(inbox)


def test_the_time_here_counts_and_what_is_too_late_is_dropped_but_no_stop() -> None:
    inbox = Inbox()
    inbox.put(datagram(b"old", until=11.9))
    inbox.put(datagram(b"new", until=12.1))
    inbox.put(datagram(b"stop", first=True, until=11.0))
    found = inbox.take(now=12.0)
    assert [each.payload for each in found if isinstance(each, Arrived)] == [b"stop", b"new"]
    assert [(each.at, each.waited) for each in found if isinstance(each, Arrived)] == [
        (12.0, 2.5),
        (12.0, 2.5),
    ]
    assert inbox.late == 1


def test_too_many_are_dropped_but_no_stop_and_no_trouble() -> None:
    inbox = Inbox()
    for _ in range(LIMIT + 5):
        inbox.put(datagram(b"x"))
    inbox.put(datagram(b"stop", first=True))
    inbox.put(Trouble("away"))
    found = taken(inbox)
    assert (found[0], found[-1], len(found), inbox.unread) == (
        b"stop",
        Trouble("away"),
        LIMIT + 2,
        5,
    )


def test_a_mistake_of_the_thread_is_raised_once() -> None:
    inbox = Inbox()
    inbox.put(datagram(b"x"))
    inbox.put_mistake(KeyError("oops"))
    with pytest.raises(KeyError, match="oops"):
        inbox.take(now=10.0)
    assert taken(inbox) == [b"x"]
