"""Outcomes on their way from the writer's thread to the loop, which is woken by a descriptor."""

import os
from threading import Lock

from mav_tasks.store.base import Kept, Outcome


class Mailbox:
    """The descriptor is readable exactly while something is in; no lock is held for long."""

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
        """Put an outcome in; of several Kept in a row the last says it all."""
        with self._lock:
            self._signal()
            if isinstance(outcome, Kept) and isinstance(self._last(), Kept):
                self._outcomes.pop()
            self._outcomes.append(outcome)

    def put_mistake(self, mistake: BaseException) -> None:
        """Let ``take`` raise what must not happen at all."""
        with self._lock:
            self._signal()
            self._mistake = mistake

    def take(self) -> list[Outcome]:
        """Take all out."""
        if not self._outcomes and self._mistake is None:  # so it is nearly always
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
        """Close the descriptor; what is in can still be taken."""
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
