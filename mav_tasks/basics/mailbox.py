"""Passes values from threads to a loop, and wakes the loop by a descriptor."""

import os
from collections.abc import Callable
from threading import Lock
from typing import Generic, TypeVar

T = TypeVar("T")


def _never(_earlier: object, _later: object) -> bool:
    return False


class Mailbox(Generic[T]):
    """A thread-safe list of values; its descriptor is readable exactly while it is not empty."""

    def __init__(self, *, replaces: Callable[[T, T], bool] = _never) -> None:
        """``replaces`` tells whether a value that is added makes the one before it superfluous."""
        self._lock = Lock()
        self._replaces = replaces
        self._values: list[T] = []
        self._mistake: BaseException | None = None
        self._read_fd, self._write_fd = os.pipe()
        self._is_open = True

    def __repr__(self) -> str:
        return f"Mailbox({self._values})"

    def __len__(self) -> int:
        return len(self._values)

    def fileno(self) -> int | None:
        """Return the descriptor; None once it is closed."""
        return self._read_fd if self._is_open else None

    def put(self, value: T) -> None:
        """Add a value."""
        with self._lock:
            self._signal()
            if self._values and self._replaces(self._values[-1], value):
                self._values.pop()
            self._values.append(value)

    def put_mistake(self, mistake: BaseException) -> None:
        """Let ``take`` raise an exception, which is a bug of ours."""
        with self._lock:
            self._signal()
            self._mistake = mistake

    def take(self) -> list[T]:
        """Remove and return all values; raise an exception of ``put_mistake``."""
        if not self._values and self._mistake is None:  # the usual case, without the lock
            return []
        with self._lock:
            values, self._values = self._values, []
            mistake, self._mistake = self._mistake, None
            if self._is_open:
                os.read(self._read_fd, 1)
        if mistake is not None:
            raise mistake
        return values

    def close(self) -> None:
        """Close the descriptor; ``take`` still returns the remaining values."""
        with self._lock:
            if self._is_open:
                self._is_open = False
                os.close(self._read_fd)
                os.close(self._write_fd)

    def _signal(self) -> None:
        if not self._values and self._mistake is None and self._is_open:
            os.write(self._write_fd, b"!")
