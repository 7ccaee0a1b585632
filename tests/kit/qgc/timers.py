"""Timed calls, in the owner's time."""

import heapq
from collections.abc import Callable, Iterator
from itertools import count


class Timer:
    """One pending call; ``cancel`` revokes it."""

    def __init__(self, call: Callable[[], None]) -> None:
        self.call: Callable[[], None] | None = call

    def cancel(self) -> None:
        """Revoke the call; no effect after it was made."""
        self.call = None


class Timers:
    """The pending calls, in seconds of the owner's time."""

    def __init__(self, *, now: float) -> None:
        self.now = now
        self._due: list[tuple[float, int, Timer]] = []
        self._order = count()

    def after(self, seconds: float, call: Callable[[], None]) -> Timer:
        """Schedule a call."""
        timer = Timer(call)
        heapq.heappush(self._due, (self.now + seconds, next(self._order), timer))
        return timer

    def live(self, doing: Iterator[float]) -> None:
        """Run an iterator that yields its waiting times in seconds, to its end."""
        seconds = next(doing, None)
        if seconds is not None:
            self.after(seconds, lambda: self.live(doing))

    def next_deadline(self) -> float | None:
        """Return when ``handle_deadline`` is due."""
        while self._due and self._due[0][2].call is None:
            heapq.heappop(self._due)
        return self._due[0][0] if self._due else None

    def handle_deadline(self, *, now: float) -> None:
        """Make the calls that are due, each at its own time."""
        while self._due and self._due[0][0] <= now:
            at, _, timer = heapq.heappop(self._due)
            call, timer.call = timer.call, None
            self.now = max(self.now, at)
            if call is not None:
                call()
        self.now = max(self.now, now)
