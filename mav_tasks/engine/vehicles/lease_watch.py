"""What a gateway's lease permits: to move its vehicles, then only to stop them, then nothing.

A server without a fleet has no lease, and needs none. ``mav_tasks.fleet`` has the rules of leases;
here is what follows for the vehicles. Packets carry the time at which the permission ends, so that
also those are dropped that leave late.
"""

from math import inf

from mav_tasks.engine.inputs import LeaseChanged
from mav_tasks.engine.packet_sender import Fence
from mav_tasks.engine.timers import Effect, Timers, Turn

SHOWN = 1.5  # s after which heartbeats, one a second, have shown what the end of set-points did


class LeaseWatch(Fence):
    """The present lease: the fence of all packets to vehicles."""

    #: called when its trust has ended, or is back
    on_change: Effect

    def __init__(self, timers: Timers, *, is_shared: bool) -> None:
        """``is_shared``: the vehicles are a fleet's, so that nothing is permitted yet."""
        until = -inf if is_shared else inf
        super().__init__(is_shared, until, until)
        self._timer = timers.timer(Turn.LINKS, self._look)
        #: whether vehicles may be moved
        self.is_trusted = not is_shared
        self._is_leaving = False
        self._back_at = -inf  # s, when it was trusted again
        #: until when packets that stop vehicles may leave, s
        self.stop_until = until

    def __repr__(self) -> str:
        return f"LeaseWatch({'trusted' if self.is_trusted else 'ended'}, {self.until})"

    def change(self, lease: LeaseChanged, *, now: float) -> None:
        """Take a new or renewed lease, or one that has ended."""
        self.relays_until = -inf if self._is_leaving else lease.move_until
        self.stop_until = lease.stop_until
        self._look(now=now)

    def leave(self, *, now: float) -> None:
        """Only stop the vehicles from here on: this gateway leaves the fleet."""
        self._is_leaving, self.is_trusted, self.relays_until = True, False, -inf
        self._look(now=now)

    def has_silenced(self, *, now: float) -> bool:
        """Return whether vehicles may show a failsafe because no set-point was permitted."""
        return self.is_shared and (not self.is_trusted or now - self._back_at <= SHOWN)

    def _look(self, *, now: float) -> None:
        """Look whether vehicles may be moved, or only stopped: it was not renewed in time."""
        was_trusted, self.is_trusted = self.is_trusted, now < self.relays_until
        self.until = self.relays_until if self.is_trusted else self.stop_until
        self._timer.set(self.relays_until if self.is_trusted else inf)
        if was_trusted is not self.is_trusted:
            self._back_at = now if self.is_trusted else self._back_at
            self.on_change(now=now)
