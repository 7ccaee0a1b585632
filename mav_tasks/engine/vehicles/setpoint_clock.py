"""When the next setpoint to a vehicle is due: at a steady rate, at other times than to others."""

from math import inf

GOLDEN = 0.6180339887  # its multiples are never close together, modulo 1


class SetpointClock:
    """Ticks of one vehicle. Times are monotonic seconds."""

    def __init__(self, system_id: int, *, period: float) -> None:
        self._phase = system_id * GOLDEN % 1.0 * period  # evenly spread, however many there are
        self._period = period
        #: inf while nothing is sent
        self.next_at = inf

    def __repr__(self) -> str:
        return f"SetpointClock(next at {self.next_at:.3f})"

    @property
    def is_running(self) -> bool:
        """Whether a tick is to come."""
        return self.next_at < inf

    def restart(self, *, now: float) -> None:
        """A setpoint has just been sent, whatever was planned: the next within a period."""
        self.next_at = now + self._period - (now - self._phase) % self._period

    def plan(self, *, now: float) -> None:
        """Plan the next tick, unless one is to come; those missed are not made up for."""
        if now < self.next_at < inf:
            return
        following = self.next_at + self._period
        if now < following < inf:
            self.next_at = following
        else:
            self.restart(now=now)

    def stop(self) -> None:
        """Tick no more."""
        self.next_at = inf

    def lateness(self, *, now: float) -> float:
        """Return the seconds by which a tick is late; below 0: none is."""
        return now - self.next_at
