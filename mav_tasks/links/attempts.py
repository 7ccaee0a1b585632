"""When a link that dials tries again, and what is said of it: once for each change."""

RETRY = 1.0  # s between two attempts


class Attempts:
    """The history of one link's attempts. ``now`` in seconds of a clock that does not go back."""

    def __init__(self) -> None:
        self._next_at = 0.0
        self._was_up = False
        self._failed = False  # since it was up, or ever

    def is_due(self, *, now: float) -> bool:
        """Whether to try now; the next one is planned then."""
        if now < self._next_at:
            return False
        self._next_at = now + RETRY
        return True

    def succeeded(self) -> str:
        """Note that the link is up; gives the words for it."""
        words = "is back" if self._was_up else "is up"
        self._was_up, self._failed = True, False
        return words

    def failed(self, reason: str) -> str | None:
        """Note that it is not; gives the words for it, None if they have been said."""
        if self._failed:
            return None
        self._failed = True
        state = "lost" if self._was_up else "is not there yet"
        return f"{state}: {reason}; trying again every second"
