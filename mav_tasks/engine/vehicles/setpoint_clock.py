"""When the next setpoint to a vehicle is due: at a steady rate, in its own phase."""

from math import inf

GOLDEN = 0.6180339887  # its multiples, modulo 1, are never close together


class SetpointClock:
    """The setpoint ticks of one vehicle. Times are monotonic seconds."""

    def __init__(self, system_id: int, *, period: float) -> None:
        self._phase = system_id * GOLDEN % 1.0 * period  # evenly spread for any number of vehicles
        self._period = period
        #: when the next tick is due; inf while nothing is sent
        self.next_at = inf

    def __repr__(self) -> str:
        return f"SetpointClock(next at {self.next_at:.3f})"

    @property
    def is_running(self) -> bool:
        """Whether a tick is planned."""
        return self.next_at < inf

    def restart(self, *, now: float) -> None:
        """Note that a setpoint was just sent out of turn; the next follows within a period."""
        self.next_at = now + self._period - (now - self._phase) % self._period

    def plan(self, *, now: float) -> None:
        """Plan the next tick, unless one is planned; missed ticks are not made up for."""
        if now < self.next_at < inf:
            return
        following = self.next_at + self._period
        if now < following < inf:
            self.next_at = following
        else:
            self.restart(now=now)

    def stop(self) -> None:
        """Cancel the next tick."""
        self.next_at = inf
