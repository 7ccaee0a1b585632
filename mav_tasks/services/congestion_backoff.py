"""How much telemetry a client's way out takes: found out by trying, as there is no other way.

While it is congested no telemetry passes at all, so that answers do not wait behind it. Each
congestion makes the intervals between telemetry messages longer, for all alike: none is left out
because its turn always comes at a bad moment. Without congestion they slowly become shorter again.
"""

from math import exp, log

WIDEN = 1.5  # by so much longer, at the beginning of a congestion, and for each AGAIN that it lasts
AGAIN = 2.0  # s
RELAX = 0.05  # per second: the part by which intervals shrink
LONGEST = 20.0  # times the interval asked for


class CongestionBackoff:
    """By which factor the intervals of one client are longer than it asked for."""

    def __init__(self) -> None:
        self._factor = 1.0
        self._at = 0.0  # when the factor was that
        self.is_congested = False
        self.is_idle = True  # there was no congestion lately: looked at for each packet

    def __repr__(self) -> str:
        return f"CongestionBackoff({self._factor:.2f}, congested={self.is_congested})"

    def note(self, is_congested: bool, *, now: float) -> None:
        """Take in that a congestion began, or ended."""
        self._factor = self.factor(now=now)
        if is_congested and not self.is_congested:
            self._factor = min(self._factor * WIDEN, LONGEST)
        self._at, self.is_congested, self.is_idle = now, is_congested, False

    def factor(self, *, now: float) -> float:
        """Return the factor, 1 or more."""
        passed = now - self._at
        if self.is_congested:
            return min(self._factor * exp(log(WIDEN) * min(passed / AGAIN, 100.0)), LONGEST)
        factor = max(1.0, self._factor * exp(-RELAX * passed))
        self.is_idle = factor == 1.0
        return factor
