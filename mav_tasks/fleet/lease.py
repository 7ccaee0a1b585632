"""A gateway's own lease: how long it may trust its last renewal.

The database decides the order: a renewal and an eviction of the same gateway exclude each other
there. No clock of the database is used, because a step of it would end all leases at once. The
holder counts from the moment at which it *sent* a renewal, and stops trusting it a margin before
the term is over. Whoever wants to evict it counts a whole term from the moment at which it *read*
that renewal (``rivals.py``), which is later. Both use their monotonic clocks.
"""

from dataclasses import dataclass, field

from mav_tasks.fleet.standing import MAY_STOP, Effect, LeaseEvent, Standing, standing_after


@dataclass(frozen=True, slots=True)
class Terms:
    """The times of a fleet, in seconds: the same for all of its gateways."""

    term: float = 1.0  # without a renewal, after which a gateway may be evicted
    margin: float = 0.3  # before that, in which it stops its vehicles
    renewal: float = 0.2  # from one renewal to the next

    def __post_init__(self) -> None:
        if not 0.0 < self.renewal < self.term - self.margin < self.term:
            raise ValueError(f"renewal < term - margin < term is needed, not {self}")


@dataclass(frozen=True, slots=True)
class Permit:
    """What a lease permits from now on: a value, so that any thread may ask it without waiting.

    It grants nothing that the lease does not: it ends by itself, at times in monotonic seconds.
    """

    standing: Standing = Standing.OUT
    trusted_until: float = 0.0
    term_end: float = 0.0
    vehicles: frozenset[int] = frozenset()
    epoch: int = 0

    def may_move(self, vehicle: int, now: float) -> bool:
        """Return whether a packet that moves this vehicle may leave now."""
        holder = self.standing is Standing.HOLDER and now < self.trusted_until
        return holder and vehicle in self.vehicles

    def may_stop(self, vehicle: int, now: float) -> bool:
        """Return whether a packet that stops this vehicle may leave now."""
        in_term = self.standing in MAY_STOP and now < self.term_end
        return in_term and vehicle in self.vehicles


@dataclass
class Lease:
    """A gateway's view of its own lease. ``now`` is in monotonic seconds everywhere."""

    terms: Terms
    epoch: int = 0  # of the gateway, given by the database; a fencing token
    standing: Standing = Standing.OUT
    vehicles: set[int] = field(default_factory=set)  # that it holds
    _renewed: float = 0.0  # when the last renewal that was accepted had been sent

    def joined(self, epoch: int, *, sent: float, now: float) -> list[Effect]:
        """Begin a lease with a new epoch, which was asked for at ``sent``."""
        self.epoch, self._renewed = epoch, sent
        self.vehicles.clear()
        return self._on(LeaseEvent.JOINED) + self.passed(now)

    def renewed(self, epoch: int, *, sent: float, now: float) -> list[Effect]:
        """Take the answer to a renewal; answers may come in any order, and late."""
        effects = self.passed(now)
        if epoch != self.epoch or sent <= self._renewed:
            return effects
        self._renewed = sent
        if now < self.trusted_until:
            effects += self._on(LeaseEvent.RENEWED)
        return effects

    def refused(self, epoch: int, *, now: float) -> list[Effect]:
        """The database refused a renewal or a write of this epoch."""
        effects = self.passed(now)
        if epoch == self.epoch:
            effects += self._on(LeaseEvent.REFUSED)
            self.vehicles.clear()
        return effects

    def left(self, now: float) -> list[Effect]:
        """Leave the fleet in order."""
        effects = self.passed(now) + self._on(LeaseEvent.LEFT)
        self.vehicles.clear()
        return effects

    def passed(self, now: float) -> list[Effect]:
        """Let time pass. Ask before each packet to a vehicle: no timer is in time for that."""
        if now >= self._renewed + self.terms.term:
            return self._on(LeaseEvent.TERM_ENDED)
        if now >= self.trusted_until:
            return self._on(LeaseEvent.TRUST_ENDED)
        return []

    @property
    def trusted_until(self) -> float:
        """When its trust in the last renewal ends."""
        return self._renewed + self.terms.term - self.terms.margin

    def next_deadline(self) -> float | None:
        """Return when ``passed`` must be called next, or None."""
        if self.standing is Standing.HOLDER:
            return self.trusted_until
        if self.standing is Standing.STOPPING:
            return self._renewed + self.terms.term
        return None

    def permit(self) -> Permit:
        """Return what it permits."""
        return Permit(
            self.standing,
            self.trusted_until,
            self._renewed + self.terms.term,
            frozenset(self.vehicles),
            self.epoch,
        )

    def may_move(self, vehicle: int, now: float) -> bool:
        """Return whether a packet that moves this vehicle may leave now."""
        return self.permit().may_move(vehicle, now)

    def may_stop(self, vehicle: int, now: float) -> bool:
        """Return whether a packet that stops this vehicle may leave now."""
        return self.permit().may_stop(vehicle, now)

    def _on(self, event: LeaseEvent) -> list[Effect]:
        self.standing, effects = standing_after(self.standing, event)
        return list(effects)
