"""The thread that writes a record, so that the disk can be as slow as it likes."""

import logging
from collections.abc import Callable
from threading import Event, Thread

log = logging.getLogger("mav_tasks")

PERIOD = 0.1  # s, between two looks at what there is to write
END_LIMIT = 2.0  # s, that the end of the server waits for what is still to be written


class WritingThread:
    """Calls ``write`` again and again, and ``end`` at the end; both own what they write to."""

    def __init__(self, name: str, *, write: Callable[[], None], end: Callable[[], None]) -> None:
        self._name = name
        self._write = write
        self._end = end
        self._is_closing = Event()
        self._thread = Thread(target=self._run, name="recorder", daemon=True)

    def __repr__(self) -> str:
        return f"WritingThread({self._name}, alive={self._thread.is_alive()})"

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """Write what is left, for a bounded time."""
        self._is_closing.set()
        self._thread.join(END_LIMIT)
        if self._thread.is_alive():
            log.warning("%s: not all is written: the disk takes too long", self._name)

    def _run(self) -> None:
        try:
            while not self._is_closing.wait(PERIOD):
                self._write()
            self._write()
            self._end()
        except Exception:  # whatever our own mistake is, no rover stands still for a record
            log.exception("%s: internal error: nothing more is written", self._name)
