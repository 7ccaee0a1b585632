"""Packets that both cores send, one of them later: each must be found again, and in time."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from .differences import Difference, Kind
from .wire import Sent

Owes = Collection[Kind]
#: fields that tell when it was sent, or that only one core has; a text's number counts texts
OF_THE_MOMENT = ("time_boot_ms", "halt_epoch", "id")


class Owed(NamedTuple):
    """A packet that one core has sent and the other one has not so far."""

    difference: Difference
    until: float


class Ledger:
    """What is owed by either core; entries do not pay for each other."""

    def __init__(self) -> None:
        self._owed: dict[object, list[Owed]] = {}

    def note(self, difference: Difference, *, by: str, within: float, owes: Owes) -> None:
        """Take a packet that only one core has sent: it is owed, or pays for an earlier one."""
        for sent, kind in ((difference.old, Kind.MISSING), (difference.new, Kind.ADDED)):
            if sent is not None:
                key = by, sent.way, said(sent)
                self._take(replace(difference, kind=kind), key, within, owes)

    def pay(self, packets: Sequence[Sent], kind: Kind, *, by: str) -> None:
        """Take what a core sends when packets are not compared any more."""
        for sent in packets if self._owed else ():
            key = by, sent.way, said(sent)
            if key in self._owed and self._owed[key][0].difference.kind is not kind:
                self._pop(key)

    def overdue(self, now: float) -> Iterator[Difference]:
        """Give what has not come in time."""
        for owed in self._owed.values():
            yield from (each.difference for each in owed if each.until < now)

    def _take(self, difference: Difference, key: object, within: float, owes: Owes) -> None:
        owed = self._owed.get(key)
        if owed and owed[0].difference.kind is not difference.kind:
            self._pop(key)
        elif difference.kind in owes:
            self._owed.setdefault(key, []).append(Owed(difference, difference.now + within))

    def _pop(self, key: object) -> None:
        owed = self._owed[key]
        del owed[0]
        if not owed:
            del self._owed[key]


def said(sent: Sent) -> str:
    """Give what a packet says, whenever it is said."""
    fields = {name: value for name, value in sent.fields.items() if name not in OF_THE_MOMENT}
    return repr((sent.name, sent.source, fields))
