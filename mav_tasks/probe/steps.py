"""A sequence of steps as a generator: it yields what it waits for, and is told whether it came.

Pure: who runs it has the time. ``interrupt`` raises inside it, where it can still clear up.
"""

from collections.abc import Callable, Generator
from typing import NamedTuple, TypeVar

T = TypeVar("T")


class Wait(NamedTuple):
    """What is waited for, and for how many seconds at the most."""

    until: Callable[[], object]
    within: float


Steps = Generator[Wait, bool, T]


def never() -> bool:
    """Nothing is waited for but the time."""
    return False


def pause(seconds: float) -> Wait:
    return Wait(never, seconds)


class Walk:
    """Walks through steps; ``now`` in monotonic seconds."""

    def __init__(self, steps: Steps[None]) -> None:
        self._steps = steps
        self._wait: Wait | None = None
        self._until = 0.0
        self._has_begun = False
        self.is_over = False

    def __repr__(self) -> str:
        return f"Walk(is_over={self.is_over})"

    def go_on(self, *, now: float) -> None:
        """Take every step that can be taken now."""
        if not self._has_begun:
            self._has_begun = True
            self._take(None, now=now)
        while self._wait is not None:
            if self._wait.until():
                self._take(True, now=now)
            elif now >= self._until:
                self._take(False, now=now)
            else:
                return

    def interrupt(self, error: Exception, *, now: float) -> None:
        """Raise in the middle of the steps; what they still do goes on."""
        if not self.is_over:
            self._set(lambda: self._steps.throw(error), now=now)
            self.go_on(now=now)

    def next_deadline(self) -> float | None:
        """Return when there is a step to take, whatever comes; None: they are over."""
        return self._until if self._wait is not None else None

    def _take(self, came: bool | None, *, now: float) -> None:
        self._set(lambda: next(self._steps) if came is None else self._steps.send(came), now=now)

    def _set(self, resume: Callable[[], Wait], *, now: float) -> None:
        try:
            self._wait = resume()
        except StopIteration:
            self._wait, self.is_over = None, True
            return
        except BaseException:
            self._wait, self.is_over = None, True
            raise
        self._until = now + self._wait.within
