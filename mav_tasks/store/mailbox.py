"""Passes outcomes from the store's threads to the loop, and wakes the loop by a descriptor."""

import os
from threading import Lock

from mav_tasks.store.base import Kept, Outcome


class Mailbox:
    """A thread-safe list of outcomes; its descriptor is readable exactly while it is not empty."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._outcomes: list[Outcome] = []
        self._mistake: BaseException | None = None
        self._read_fd, self._write_fd = os.pipe()
        self._is_open = True

    def __repr__(self) -> str:
        return f"Mailbox({self._outcomes})"

    def fileno(self) -> int | None:
        """Return the descriptor; None once it is closed."""
        return self._read_fd if self._is_open else None

    def put(self, outcome: Outcome) -> None:
        """Add an outcome; a Kept replaces a Kept directly before it."""
        with self._lock:
            self._signal()
            if isinstance(outcome, Kept) and isinstance(self._last(), Kept):
                self._outcomes.pop()
            self._outcomes.append(outcome)

    def put_mistake(self, mistake: BaseException) -> None:
        """Let ``take`` raise an exception, which is a bug of ours."""
        with self._lock:
            self._signal()
            self._mistake = mistake

    def take(self) -> list[Outcome]:
        """Remove and return all outcomes; raise an exception of ``put_mistake``."""
        if not self._outcomes and self._mistake is None:  # the usual case, without the lock
            return []
        with self._lock:
            outcomes, self._outcomes = self._outcomes, []
            mistake, self._mistake = self._mistake, None
            if self._is_open:
                os.read(self._read_fd, 1)
        if mistake is not None:
            raise mistake
        return outcomes

    def close(self) -> None:
        """Close the descriptor; ``take`` still returns the remaining outcomes."""
        with self._lock:
            if self._is_open:
                self._is_open = False
                os.close(self._read_fd)
                os.close(self._write_fd)

    def _last(self) -> Outcome | None:
        return self._outcomes[-1] if self._outcomes else None

    def _signal(self) -> None:
        if not self._outcomes and self._mistake is None and self._is_open:
            os.write(self._write_fd, b"!")
