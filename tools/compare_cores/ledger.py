"""Packets that both cores send, one of them later: each must be found again, and in time."""

from collections.abc import Iterator
from typing import NamedTuple

from .differences import Difference, Kind
from .entries import Intended


class Owed(NamedTuple):
    """A packet that one core has sent and the other one has not so far."""

    difference: Difference
    until: float


class Ledger:
    """What is owed by either core; entries do not pay for each other."""

    def __init__(self) -> None:
        self._owed: dict[object, list[Owed]] = {}

    def note(self, difference: Difference, entry: Intended) -> None:
        """Take a packet that only one core has sent: it is owed, or pays for an earlier one."""
        sent = difference.new or difference.old
        assert sent is not None
        key = entry.name, sent.way, sent.content[:3]  # whatever waits before it
        owed = self._owed.setdefault(key, [])
        if owed and owed[0].difference.kind is not difference.kind:
            del owed[0]
        elif difference.kind in entry.owes:
            owed.append(Owed(difference, difference.now + entry.within))
        if not owed:
            del self._owed[key]

    def overdue(self, now: float) -> Iterator[Difference]:
        """Give what has not come in time."""
        for owed in self._owed.values():
            yield from (each.difference for each in owed if each.until < now)


def can_move(difference: Difference) -> bool:
    """Whether a difference is of a packet that only one core has sent."""
    return difference.kind in (Kind.MISSING, Kind.ADDED)
