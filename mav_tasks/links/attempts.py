"""When a dialling link tries again, and the log texts for it: one for each change."""

RETRY = 1.0  # s between two attempts


class Attempts:
    """The history of one link's attempts. ``now``: seconds of a monotonic clock."""

    def __init__(self) -> None:
        self._next_at = 0.0
        self._was_up = False
        self._failed = False  # since the link was last up

    def is_due(self, *, now: float) -> bool:
        """Return whether to try now; if so, plan the next attempt."""
        if now < self._next_at:
            return False
        self._next_at = now + RETRY
        return True

    def succeeded(self) -> str:
        """Note that the link is up; return the log text."""
        words = "is back" if self._was_up else "is up"
        self._was_up, self._failed = True, False
        return words

    def failed(self, reason: str) -> str | None:
        """Note that the link is down; return the log text, None if it was logged before."""
        if self._failed:
            return None
        self._failed = True
        state = "lost" if self._was_up else "is not available yet"
        return f"{state}: {reason}; trying again every second"
