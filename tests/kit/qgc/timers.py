"""Calls at a time, in whatever time the owner lives."""

import heapq
from collections.abc import Callable, Iterator
from itertools import count


class Timer:
    """One call that is to come; ``cancel`` takes it back."""

    def __init__(self, call: Callable[[], None]) -> None:
        self.call: Callable[[], None] | None = call

    def cancel(self) -> None:
        """Never make the call; after it nothing changes."""
        self.call = None


class Timers:
    """The calls that are to come, in seconds of the owner's time."""

    def __init__(self, *, now: float) -> None:
        self.now = now
        self._due: list[tuple[float, int, Timer]] = []
        self._order = count()

    def after(self, seconds: float, call: Callable[[], None]) -> Timer:
        """Call later."""
        timer = Timer(call)
        heapq.heappush(self._due, (self.now + seconds, next(self._order), timer))
        return timer

    def live(self, doing: Iterator[float]) -> None:
        """Run what says how many seconds it waits, until it is through."""
        seconds = next(doing, None)
        if seconds is not None:
            self.after(seconds, lambda: self.live(doing))

    def next_deadline(self) -> float | None:
        """Return when ``handle_deadline`` has something to do."""
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
