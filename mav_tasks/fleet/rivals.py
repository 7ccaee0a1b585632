"""The other gateways of a fleet, as one gateway sees them: whom it may evict, and when.

A gateway may be evicted if its renewals were seen to stand still for a whole term, counted from
the answer that showed the last one. An observer that cannot read the database for a while counts
anew: perhaps no gateway could renew meanwhile, and that must evict none.

Quicker, if its process has certainly ended: its session at the database is gone, and its host
says that nobody listens at its port any more, though there were answers from there just before.
A lost session alone proves nothing: a cut connection looks the same, and its rovers may be driven
on for the rest of its term.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from mav_tasks.fleet.lease import Terms

RECENT = 1.0  # s; how old the last answer of a peer may be, so that a refusal counts


@dataclass(frozen=True, slots=True)
class Rival:
    """Another gateway's row in the database, as it was read."""

    name: str
    epoch: int
    renewals: int  # how often it has renewed in this epoch
    in_session: bool  # whether its session at the database is there
    holds: frozenset[int] = frozenset()  # vehicles
    hears: frozenset[int] = frozenset()  # vehicles that it does not hold


@dataclass(frozen=True, slots=True)
class Eviction:
    """A wish that the database grants only if the row is still as it was read."""

    name: str
    epoch: int
    renewals: int


@dataclass
class Seen:
    """A rival's row, and since when it is as it is."""

    row: Rival
    since: float | None  # None: not read since the database was lost
    answered: float | None = None  # when its process last answered
    is_refused: bool = False  # its host says that nobody listens there, after that answer


@dataclass
class Rivals:
    """All other gateways. ``now`` is in monotonic seconds."""

    terms: Terms
    _seen: dict[str, Seen] = field(default_factory=dict)
    _read: float | None = None  # when the database was last read

    def read(self, rows: Iterable[Rival], *, now: float) -> None:
        """Take the rows of an answer that has just come."""
        if self._read is not None and now - self._read > self.terms.term:
            self.lost()
        self._read = now
        rows = list(rows)
        names = {row.name for row in rows}
        for name in set(self._seen) - names:
            del self._seen[name]
        for row in rows:
            seen = self._seen.get(row.name)
            if seen is None or seen.row.epoch != row.epoch:
                self._seen[row.name] = Seen(row, now)
                continue
            if seen.since is None or seen.row.renewals != row.renewals:
                seen.since = now
            seen.row = row

    def lost(self) -> None:
        """The connection to the database was lost: count anew from the next answer."""
        self._read = None
        for seen in self._seen.values():
            seen.since = None

    def answered(self, name: str, *, now: float) -> None:
        """A rival's process has answered."""
        if (seen := self._seen.get(name)) is not None:
            seen.answered, seen.is_refused = now, False

    def refused(self, name: str, *, now: float) -> bool:
        """A rival's host says that nobody listens at its port; return whether that is news."""
        seen = self._seen.get(name)
        if seen is None or seen.answered is None or now - seen.answered > RECENT:
            return False
        is_news, seen.is_refused = not seen.is_refused, True
        return is_news

    def evictions(self, now: float) -> list[Eviction]:
        """Return whom to evict now."""
        if self._read is None or now - self._read > self.terms.term:
            return []
        return [
            Eviction(name, seen.row.epoch, seen.row.renewals)
            for name, seen in self._seen.items()
            if self._is_dead(seen, now)
        ]

    def held(self) -> set[int]:
        """Return the vehicles that they hold."""
        return {vehicle for seen in self._seen.values() for vehicle in seen.row.holds}

    def holders(self) -> dict[int, str]:
        """Return which of them holds which vehicle."""
        return {vehicle: name for name, seen in self._seen.items() for vehicle in seen.row.holds}

    def hearers(self, now: float) -> dict[int, str]:
        """Return which of them hears which vehicle without holding it, and can take it now."""
        return {
            vehicle: name
            for name, seen in self._seen.items()
            if self._is_well(seen, now)
            for vehicle in seen.row.hears
        }

    def epochs(self) -> dict[str, int]:
        """Return the epoch of each row, by name."""
        return {name: seen.row.epoch for name, seen in self._seen.items()}

    def is_one_ending(self) -> bool:
        """Return whether one's process has ended, as it seems, and its session is not gone yet."""
        return any(seen.is_refused and seen.row.in_session for seen in self._seen.values())

    def _is_well(self, seen: Seen, now: float) -> bool:
        """Return whether its renewals come: one that cannot renew could not take a vehicle."""
        if seen.is_refused or not seen.row.in_session or seen.since is None:
            return False
        return now - seen.since < self.terms.term - self.terms.margin

    def _is_dead(self, seen: Seen, now: float) -> bool:
        if seen.is_refused and not seen.row.in_session:
            return True
        return seen.since is not None and now - seen.since >= self.terms.term
