"""Processes as bookmarks: each holds one state of a world, from which every deed is tried.

A world cannot be copied within a process, but a fork copies all of it. A bookmark waits for a
deed's number, forks, and the child does the deed and reports the result. The child then becomes the
next bookmark or ends. Only one deed runs at a time.
"""

import ctypes
import gc
import os
import pickle
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

PATIENCE = 60.0  # s for a deed
PR_SET_PDEATHSIG = 1  # of prctl(2), Linux: a bookmark ends with its parent
MOST = 1 << 20  # bytes of a report


class Forks:
    """The bookmarks of one search; ``do`` changes the world in its process."""

    def __init__(self, folder: Path, do: Callable[[int], Any]) -> None:
        """Fork the first bookmark; ``do`` does a deed by number and returns a picklable report."""
        self._do = do
        self._folder = folder
        self._ours = self._socket("searcher")
        self._ours.settimeout(PATIENCE)
        self._last = 0
        self._kept = [0]
        self._pid = self._fork_first()

    def __repr__(self) -> str:
        return f"Forks({self._last})"

    def attempt(self, bookmark: int, deed: int) -> tuple[int, Any]:
        """Do a deed from a bookmark; return the number of the new state, and the report."""
        self._last += 1
        self._tell(bookmark, (deed, self._last))
        return self._last, self._hear()

    def decide(self, number: int, *, keep: bool) -> None:
        """Keep the new state as a bookmark, or end it."""
        if keep:
            self._kept.append(number)
        self._tell(number, keep)

    def close(self) -> None:
        """End all bookmarks; only the first one is our child and needs waiting."""
        for number in reversed(self._kept):  # one that ends takes its children with it
            self._tell(number, None)
        self._ours.close()
        os.waitpid(self._pid, 0)

    def _socket(self, name: str) -> socket.socket:
        end = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        end.bind(str(self._folder / name))
        return end

    def _tell(self, number: int, word: object) -> None:
        self._ours.sendto(pickle.dumps(word), str(self._folder / str(number)))

    def _hear(self) -> Any:
        return pickle.loads(self._ours.recv(MOST))

    def _fork_first(self) -> int:
        """Fork the first bookmark, and wait until it is ready."""
        pid = os.fork()
        if pid == 0:
            self._live(self._socket("0"), None)
        self._hear()
        return pid

    def _live(self, end: socket.socket, report: object) -> None:
        """Run as a bookmark, or as a state that may become one; never returns."""
        status = 1
        try:
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # its children are reaped automatically
            searcher = str(self._folder / "searcher")
            end.sendto(pickle.dumps(report), searcher)
            if report is not None and not pickle.loads(end.recv(MOST)):
                os._exit(0)
            gc.freeze()
            while (word := pickle.loads(end.recv(MOST))) is not None:
                deed, number = word
                if os.fork() == 0:
                    end.close()
                    end = self._socket(str(number))
                    try:
                        report = self._do(deed)
                    except BaseException as mistake:  # noqa: BLE001 - reported and judged elsewhere
                        report = mistake
                    self._live(end, report)
            status = 0
        finally:
            os._exit(status)
