"""The way out of log lines: a queue that never waits, and a thread that does.

Standard error may be a pipe that nobody reads, a terminal that was halted by Ctrl-S, or a file on
a disk that is full. A server that waits for it does not stop a rover in time: so lines are lost and
counted instead. It writes past ``sys.stderr``, whose lock the interpreter would want in the end.
"""

import logging
import os
import select
import threading
import time
from collections.abc import Iterable
from queue import Empty, SimpleQueue

from mav_tasks.logs.lines import Lines

MOST = 10_000  # lines that wait; what comes then is lost
GATHER = 0.02  # s, in which more may come to be written with the first
BATCH = 1_000  # lines in one write
LOOK = 1.0  # s, after which what was counted is looked at, though nothing was said
RETRY = 0.5  # s, after what could not be written
LAST_WORDS = 1.0  # s, for what is left when the server ends


class ThreadedHandler(logging.Handler):
    """Makes a line of a record at once; a thread of its own writes it to a descriptor.

    The line is not made by the thread: that would take the interpreter from the loop at any moment.
    """

    def __init__(self, fd: int, lines: Lines) -> None:
        super().__init__()
        self._fd = fd
        self._lines = lines  # used with this handler's lock only
        self._waiting: SimpleQueue[str] = SimpleQueue()
        self._is_ending = threading.Event()
        self._not_taken = 0  # counted by who logs,
        self._not_written = 0  # by the thread,
        self._told = 0  # both: what has been told of them
        self._is_torn = False  # the last line written was not written to its end
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"ThreadedHandler({self._waiting.qsize()} waiting, {self._lost} lost)"

    def emit(self, record: logging.LogRecord) -> None:
        """Take a record; called with this handler's lock."""
        if self._waiting.qsize() >= MOST:
            self._not_taken += 1
            return
        try:
            line = self._lines.of(record, now=time.monotonic())
        except Exception as mistake:  # noqa: BLE001 - ours, and no reason for a rover to stand
            line = f"a line cannot be said: {mistake!r}"
        if line is not None:
            self._waiting.put(line)

    def close(self) -> None:
        """Write what is left, for LAST_WORDS at most: who does not read by then does not get it."""
        if not self._is_ending.is_set():
            self._is_ending.set()
            self._waiting.put("")  # it waits for something
            self._thread.join(LAST_WORDS)
        super().close()

    @property
    def _lost(self) -> int:
        return self._not_taken + self._not_written

    def _run(self) -> None:
        while not (self._is_ending.is_set() and self._waiting.empty()):
            lines = self._collect()
            self.acquire()
            try:
                lines += self._lines.due(now=time.monotonic())
            finally:
                self.release()
            self._write(lines)
        self._write(self._lines.rest(now=time.monotonic()))

    def _collect(self) -> list[str]:
        """Wait for lines, but not longer than LOOK; gives some that wait."""
        lines: list[str] = []
        try:
            lines.append(self._waiting.get(timeout=LOOK))
            if self._waiting.empty():
                self._is_ending.wait(GATHER)
            while len(lines) < BATCH:
                lines.append(self._waiting.get_nowait())
        except Empty:
            pass
        return lines

    def _write(self, lines: Iterable[str]) -> None:
        text = "".join(f"{line}\n" for line in lines if line)
        if not text:
            return
        left = self._left_of(text)
        self._not_written += left
        lost = self._lost
        if left == 0 and lost > self._told and self._left_of(self._gap(lost - self._told)) == 0:
            self._told = lost

    def _gap(self, lost: int) -> str:
        words = f"lines of this log that were not taken in time, and are lost: {lost}"
        record = logging.makeLogRecord(
            {"msg": words, "levelname": "WARNING", "levelno": logging.WARNING}
        )
        return f"{self._lines.line(record)}\n"

    def _left_of(self, text: str) -> int:
        """Write lines; gives how many of them could not be written."""
        data = text.encode("utf-8", "backslashreplace")
        rest = memoryview(b"\n" + data if self._is_torn else data)
        while rest:
            try:
                rest = rest[os.write(self._fd, rest) :]
                self._is_torn = False
            except BlockingIOError:  # somebody who shares it made it so
                select.select([], [self._fd], [], RETRY)
            except OSError:
                self._is_torn = self._is_torn or len(rest) < len(data)
                self._is_ending.wait(RETRY)
                return bytes(rest).count(b"\n")
        return 0
