"""A gateway in its fleet: what it asks the database for, and what follows from the answers.

No I/O: ``requests`` returns what to ask, one at a time; the caller passes each answer, or its
absence, to ``answered`` or ``unanswered``.
"""

from dataclasses import dataclass, field

from mav_tasks.fleet.lease import Lease, Terms
from mav_tasks.fleet.rivals import Eviction, Rival, Rivals
from mav_tasks.fleet.standing import Effect, Standing


@dataclass(frozen=True, slots=True)
class Join:
    """Give this gateway a new epoch. The database refuses while another session has its name."""

    name: str


@dataclass(frozen=True, slots=True)
class Renew:
    """Renew the lease, and read the rows of the others."""

    name: str
    epoch: int


@dataclass(frozen=True, slots=True)
class Evict:
    """End another gateway's lease, and free its vehicles, if its row is still as it was read."""

    by: Renew
    rival: Eviction


@dataclass(frozen=True, slots=True)
class Take:
    """Give this gateway a vehicle that nobody holds."""

    by: Renew
    vehicle: int


@dataclass(frozen=True, slots=True)
class Free:
    """Free a vehicle, which this gateway has stopped and dropped."""

    by: Renew
    vehicle: int


Request = Join | Renew | Evict | Take | Free


@dataclass(frozen=True, slots=True)
class Row:
    """The database's answer to each request: what this gateway has, and the rows of the others."""

    epoch: int  # of this gateway, 0 if it is not in the fleet (any more)
    holds: frozenset[int]
    rivals: tuple[Rival, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """What changed for this gateway: effects in their order, vehicles that it has got or lost."""

    effects: tuple[Effect, ...] = ()
    got: frozenset[int] = frozenset()
    lost: frozenset[int] = frozenset()


@dataclass
class Member:
    """A gateway's part of the fleet. ``now`` is in monotonic seconds."""

    name: str
    terms: Terms
    heard: set[int] = field(default_factory=set)  # vehicles with heartbeats on its own links
    lease: Lease = field(init=False)
    rivals: Rivals = field(init=False)
    _next: float = 0.0  # when the next renewal is due

    def __post_init__(self) -> None:
        self.lease, self.rivals = Lease(self.terms), Rivals(self.terms)

    def request(self, now: float) -> Request | None:
        """Return what to ask the database now, or None; one request at a time."""
        if self.lease.standing in (Standing.OUT, Standing.EVICTED):
            return self._at_its_time(Join(self.name), now)
        me = Renew(self.name, self.lease.epoch)
        renewal = self._at_its_time(me, now)
        if renewal is not None or self.lease.standing is not Standing.HOLDER:
            return renewal
        if evictions := self.rivals.evictions(now):
            return Evict(me, evictions[0])
        free = self.heard - self.lease.vehicles - self.rivals.held()
        return Take(me, min(free)) if free else None

    def answered(self, request: Request, row: Row, *, sent: float, now: float) -> Change:
        """Take an answer to a request that had been sent at ``sent``."""
        before = frozenset(self.lease.vehicles)
        self.rivals.read(row.rivals, now=now)
        if isinstance(request, Join):
            effects = [] if row.epoch == 0 else self.lease.joined(row.epoch, sent=sent, now=now)
        else:
            asked = request if isinstance(request, Renew) else request.by
            if row.epoch != asked.epoch:
                effects = self.lease.refused(asked.epoch, now=now)
            elif isinstance(request, Renew):
                effects = self.lease.renewed(row.epoch, sent=sent, now=now)
            else:
                effects = self.lease.passed(now)
        if row.epoch == self.lease.epoch:
            self.lease.vehicles = set(row.holds)
        after = frozenset(self.lease.vehicles)
        return Change(tuple(effects), after - before, before - after)

    def unanswered(self, now: float) -> Change:
        """The connection to the database was lost, with whatever was asked for."""
        self.rivals.lost()
        return Change(tuple(self.lease.passed(now)))

    def peer_answered(self, name: str, *, now: float) -> None:
        """Another gateway's process has answered."""
        self.rivals.answered(name, now=now)

    def peer_refused(self, name: str, *, now: float) -> None:
        """Another gateway's host says that nobody listens there: read its row at once."""
        if self.rivals.refused(name, now=now):
            self._next = now

    def _at_its_time(self, request: Request, now: float) -> Request | None:
        if now < self._next:
            return None
        self._next = now + self.terms.renewal
        return request
