"""The thread that writes a record, so that a slow disk never blocks the loop."""

import logging
from collections.abc import Callable
from threading import Event, Thread

log = logging.getLogger("mav_tasks")

PERIOD = 0.1  # s between two calls of ``write``
END_LIMIT = 2.0  # s, maximum wait for the last writes at shutdown


class WritingThread:
    """Calls ``write`` every PERIOD, and ``end`` at the end, in its own thread, from creation on."""

    def __init__(self, name: str, *, write: Callable[[], None], end: Callable[[], None]) -> None:
        self._name = name
        self._write = write
        self._end = end
        self._is_closing = Event()
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"WritingThread({self._name}, alive={self._thread.is_alive()})"

    def close(self) -> None:
        """Write the rest and end; wait at most END_LIMIT."""
        self._is_closing.set()
        self._thread.join(END_LIMIT)
        if self._thread.is_alive():
            log.warning("%s: incomplete: the disk is too slow", self._name)

    def _run(self) -> None:
        try:
            while not self._is_closing.wait(PERIOD):
                self._write()
            self._write()
            self._end()
        except Exception:  # a bug in a recorder must not stop a rover
            log.exception("%s: internal error: switched off", self._name)
