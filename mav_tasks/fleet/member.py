"""A gateway in its fleet: what it asks the database for, and what follows from the answers.

No I/O: ``request`` returns what to ask, one at a time; the caller passes each answer, or its
absence, to ``answered`` or ``unanswered``.

A vehicle that this gateway does not hear any more, but another one does, changes hands in order:
``Change.lets_go`` asks the engine to forget it, ``forgotten`` says that the engine has, and only
then the database is asked to free it. The engine may refuse, and is asked again later.
"""

from dataclasses import dataclass, field

from mav_tasks.fleet.lease import Lease, Terms
from mav_tasks.fleet.rivals import Eviction, Rival, Rivals
from mav_tasks.fleet.standing import Effect, Standing

#: s for which a gateway leaves a vehicle that it has freed to those that say they hear it
LEFT_TO_OTHERS = 10.0
RECHECK = 0.03  # s; how soon to look whether the session of a process that has ended is gone


@dataclass(frozen=True, slots=True)
class Join:
    """Begin a new epoch of this gateway, unless another process has its name.

    A process that lost its session may still move vehicles under this name: a row of an unknown
    epoch ends as that of any other gateway does, by an eviction.
    """

    name: str
    replaced: Eviction | None = None


@dataclass(frozen=True, slots=True)
class Renew:
    """Renew the lease, say what is heard, and read the rows of the others."""

    name: str
    epoch: int
    hears: frozenset[int] = frozenset()  # vehicles that this gateway does not hold


@dataclass(frozen=True, slots=True)
class Evict:
    """End another gateway's lease, and free its vehicles, if its row is still as it was read."""

    by: Renew
    rival: Eviction


@dataclass(frozen=True, slots=True)
class Take:
    """Take for this gateway those of these vehicles that no gateway holds."""

    by: Renew
    vehicles: frozenset[int]


@dataclass(frozen=True, slots=True)
class Free:
    """Free a vehicle, which the engine of this gateway has forgotten."""

    by: Renew
    vehicle: int


Request = Join | Renew | Evict | Take | Free


@dataclass(frozen=True, slots=True)
class Row:
    """The database's answer to each request: what this gateway has, and all other rows.

    One of these may have its name: that of another process, or of a Join without an answer.
    """

    epoch: int  # of this gateway, 0 if the request was refused
    holds: frozenset[int]
    rivals: tuple[Rival, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """What changed for this gateway: effects in their order, vehicles that it has got or lost.

    ``lets_go``: vehicles to forget, if the engine can, each with the gateway that hears it.
    """

    effects: tuple[Effect, ...] = ()
    got: frozenset[int] = frozenset()
    lost: frozenset[int] = frozenset()
    lets_go: tuple[tuple[int, str], ...] = ()


@dataclass
class Member:
    """A gateway's part of the fleet. ``now`` is in monotonic seconds."""

    name: str
    terms: Terms
    heard: set[int] = field(default_factory=set)  # vehicles with heartbeats on its own links
    #: vehicles that it holds, and that the engine could forget: not heard for a while, idle
    strays: frozenset[int] = frozenset()
    lease: Lease = field(init=False)
    rivals: Rivals = field(init=False)
    next_turn: float = 0.0  # when the next renewal, or attempt to join, is due
    _forgotten: set[int] = field(default_factory=set)  # by the engine, but not freed yet
    _freed: dict[int, float] = field(default_factory=dict)  # when, of those left to others
    _is_others_turn: bool = False  # of other requests, though a renewal is due: answers take long

    def __post_init__(self) -> None:
        self.lease, self.rivals = Lease(self.terms), Rivals(self.terms)

    def request(self, now: float) -> Request | None:
        """Return what to ask the database now, or None; one request at a time."""
        standing, is_due = self.lease.standing, now >= self.next_turn
        if standing in (Standing.OUT, Standing.EVICTED):
            return self._timed(Join(self.name, self._predecessor(now)), now) if is_due else None
        me = Renew(self.name, self.lease.epoch, frozenset(self.heard - self.lease.vehicles))
        other = self._change(me, now) if standing is Standing.HOLDER else None
        if is_due and not (other and self._is_others_turn):
            self._is_others_turn = True
            return self._timed(me, now)
        self._is_others_turn = False
        return other

    def answered(self, request: Request, row: Row, *, sent: float, now: float) -> Change:
        """Take an answer to a request that had been sent at ``sent``."""
        before = frozenset(self.lease.vehicles)
        self.rivals.read(row.rivals, now=now)
        self._forgotten -= self.heard  # heard again in time: it stays, and is loaded again
        if isinstance(request, Join):
            self._forgotten.clear()
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
            if isinstance(request, Free) and request.vehicle not in row.holds:
                self._freed[request.vehicle] = now
            self._forgotten &= row.holds
            self.lease.vehicles = set(row.holds) - self._forgotten
        after = frozenset(self.lease.vehicles)
        return Change(tuple(effects), after - before, before - after, self._to_let_go(now))

    def unanswered(self, now: float) -> Change:
        """The connection to the database was lost, with whatever was asked for."""
        self.rivals.lost()
        return Change(tuple(self.lease.passed(now)))

    def forgotten(self, vehicles: frozenset[int]) -> None:
        """The engine has forgotten these vehicles: free them, unless they are heard again."""
        self._forgotten |= vehicles & self.lease.vehicles
        self.lease.vehicles -= vehicles

    def peer_answered(self, name: str, *, now: float) -> None:
        """Another gateway's process has answered."""
        self.rivals.answered(name, now=now)

    def peer_refused(self, name: str, *, now: float) -> None:
        """Another gateway's host says that nobody listens there: read its row at once."""
        if self.rivals.refused(name, now=now):
            self.next_turn = now

    def _predecessor(self, now: float) -> Eviction | None:
        """Return the row of its own name, if it may be evicted."""
        return next((each for each in self.rivals.evictions(now) if each.name == self.name), None)

    def _change(self, me: Renew, now: float) -> Request | None:
        """Return what to change in the database, if anything."""
        if evictions := self.rivals.evictions(now):
            return Evict(me, evictions[0])
        if to_free := self._forgotten - self.heard:
            return Free(me, min(to_free))
        ours = self.lease.vehicles | self._forgotten
        free = self.heard - ours - self.rivals.held() - self._left_to_others(now)
        return Take(me, frozenset(free)) if free else None

    def _to_let_go(self, now: float) -> tuple[tuple[int, str], ...]:
        """Return the vehicles that another gateway hears and this one does not."""
        unheard = self.lease.vehicles & self.strays - self.heard
        if not unheard or self.lease.standing is not Standing.HOLDER:
            return ()
        hearers = self.rivals.hearers(now)
        return tuple((each, hearers[each]) for each in sorted(unheard & hearers.keys()))

    def _left_to_others(self, now: float) -> set[int]:
        """Return vehicles that it freed just now and that nobody has had since."""
        for vehicle in self.rivals.held() & self._freed.keys():
            del self._freed[vehicle]
        recent = {each for each, at in self._freed.items() if now - at < LEFT_TO_OTHERS}
        for vehicle in self._freed.keys() - recent:
            del self._freed[vehicle]
        return recent & self.rivals.hearers(now).keys()

    def _timed(self, request: Request, now: float) -> Request:
        """Return a request that shows the others' rows, and set when the next one is due."""
        self.next_turn = now + (RECHECK if self.rivals.is_one_ending() else self.terms.renewal)
        return request
