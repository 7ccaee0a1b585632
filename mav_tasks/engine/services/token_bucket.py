"""A token bucket: how much may pass in the long run, and at once. Pure."""


class TokenBucket:
    """``rate`` a second in the long run, ``burst`` at once; full at ``now``, or any time later."""

    def __init__(self, *, rate: float, burst: float, now: float = 0.0) -> None:
        self.rate = rate  #: what may pass in a second in the long run
        self._burst = self._tokens = burst
        self._at = now

    def __repr__(self) -> str:
        return f"TokenBucket({self._tokens:.1f} of {self._burst:g}, {self.rate:g}/s)"

    def take(self, *, now: float, tokens: float = 1.0) -> bool:
        """Whether one more may pass now, or what is worth several."""
        self._tokens = min(self._burst, self._tokens + self.rate * (now - self._at))
        self._at = now
        if self._tokens < tokens:
            return False
        self._tokens -= tokens
        return True
