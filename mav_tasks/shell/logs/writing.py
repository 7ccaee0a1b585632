"""Writes log lines: a queue that never blocks the loop, and a thread that may block.

Standard error may be a pipe that nobody reads, a terminal paused by Ctrl-S, or a file on a full
disk. A server that waits for it cannot stop a rover in time: lines are dropped and counted instead.
The thread bypasses ``sys.stderr``: the interpreter needs that object's lock at exit.
"""

import logging
import os
import select
import threading
import time
from collections.abc import Iterable
from queue import Empty, SimpleQueue

from mav_tasks.shell.logs.lines import Lines

MOST = 10_000  # waiting lines; more are dropped
GATHER = 0.02  # s, in which more lines are collected for a write
BATCH = 1_000  # lines in one write
LOOK = 1.0  # s, maximum wait for a line before repeated messages are checked
RETRY = 0.5  # s after a failed write
LAST_WORDS = 1.0  # s for the remaining lines at shutdown


class ThreadedHandler(logging.Handler):
    """Formats each record at once; its thread writes the lines to a descriptor.

    The thread does not format: it would take the GIL from the loop at any moment.
    """

    def __init__(self, fd: int, lines: Lines) -> None:
        super().__init__()
        self._fd = fd
        self._lines = lines  # used only with this handler's lock
        self._waiting: SimpleQueue[str] = SimpleQueue()
        self._is_ending = threading.Event()
        self._not_taken = 0  # lines dropped in ``emit``
        self._not_written = 0  # lines dropped by the thread
        self._told = 0  # the part of both that the log has reported
        self._is_torn = False  # the last line was written only in part
        self._thread = threading.Thread(target=self._run, name="log", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        return f"ThreadedHandler({self._waiting.qsize()} waiting, {self._lost} lost)"

    def emit(self, record: logging.LogRecord) -> None:
        """Format and queue a record; called with this handler's lock."""
        if self._waiting.qsize() >= MOST:
            self._not_taken += 1
            return
        try:
            line = self._lines.of(record, now=time.monotonic())
        except Exception as mistake:  # noqa: BLE001 - a bug of ours must not stop a rover
            line = f"a log line cannot be formatted: {mistake!r}"
        if line is not None:
            self._waiting.put(line)

    def close(self) -> None:
        """Write the remaining lines; give up after LAST_WORDS if the reader is blocked."""
        if not self._is_ending.is_set():
            self._is_ending.set()
            self._waiting.put("")  # wakes the thread
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
        """Wait for lines, at most LOOK; return up to BATCH of them."""
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
        words = f"log lines lost: {lost} (the reader or the disk was too slow)"
        record = logging.makeLogRecord(
            {"msg": words, "levelname": "WARNING", "levelno": logging.WARNING}
        )
        return f"{self._lines.line(record)}\n"

    def _left_of(self, text: str) -> int:
        """Write lines; return the number of lines that could not be written."""
        data = text.encode("utf-8", "backslashreplace")
        rest = memoryview(b"\n" + data if self._is_torn else data)
        while rest:
            try:
                rest = rest[os.write(self._fd, rest) :]
                self._is_torn = False
            except BlockingIOError:  # another process that shares it made it non-blocking
                select.select([], [self._fd], [], RETRY)
            except OSError:
                self._is_torn = self._is_torn or len(rest) < len(data)
                self._is_ending.wait(RETRY)
                return bytes(rest).count(b"\n")
        return 0
