"""A program at a terminal of a size, and what an emulator of such a terminal then shows."""

import os
import pty
import select
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pyte

from tests.kit.processes import STOP_LIMIT

CTRL_C = b"\x03"
#: makes the terminal its own, so that Ctrl-C and a change of size reach it as they reach a shell's
LAUNCH = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)


class Terminal:
    """A running program with its screen; ``written`` are all bytes that came, as they came."""

    def __init__(
        self, popen: subprocess.Popen[bytes], own_side: int, size: tuple[int, int]
    ) -> None:
        self.popen = popen
        self.written = b""
        self._own_side = own_side
        rows, columns = size
        self._screen: Any = pyte.Screen(columns, rows)
        self._stream: Any = pyte.ByteStream(self._screen)

    @property
    def lines(self) -> list[str]:
        """Return what the screen shows, without blanks at the ends of lines, and lines below."""
        lines = [str(line).rstrip() for line in self._screen.display]
        while lines and not lines[-1]:
            del lines[-1]
        return lines

    @property
    def text(self) -> str:
        """The same as one text."""
        return "\n".join(self.lines)

    def wait_for(self, condition: Callable[[str], object], *, within: float = 20.0) -> None:
        """Wait until the screen shows something."""
        end = time.monotonic() + within
        while not condition(self.text):
            assert time.monotonic() < end, f"not in {within} s on:\n{self.text}"
            assert self._read(end - time.monotonic()), f"it ended:\n{self.text}"

    def type(self, keys: bytes) -> None:
        """Press keys."""
        os.write(self._own_side, keys)

    def resize(self, rows: int, columns: int) -> None:
        """Return the window another size; the program is told so by the system."""
        self._screen.resize(rows, columns)
        termios.tcsetwinsize(self._own_side, (rows, columns))

    def end(self, *, within: float = 20.0) -> int:
        """Read to the end; gives the exit status."""
        end = time.monotonic() + within
        while self._read(end - time.monotonic()):
            assert time.monotonic() < end, f"still there after {within} s:\n{self.text}"
        return self.popen.wait(STOP_LIMIT)

    def _read(self, within: float) -> bool:
        """Read what there is, after so long at the most; whether more may come."""
        if not select.select([self._own_side], [], [], max(within, 0.0))[0]:
            return True
        data = b""
        with suppress(OSError):  # how a terminal ends whose other side is gone
            data = os.read(self._own_side, 65536)
        self.written += data
        self._stream.feed(data)
        return bool(data)


@contextmanager
def terminal(
    *arguments: str, size: tuple[int, int] = (24, 80), environment: dict[str, str] | None = None
) -> Iterator[Terminal]:
    """Run Python with these arguments at a terminal of so many rows and columns."""
    own_side, its_side = pty.openpty()
    termios.tcsetwinsize(its_side, size)
    unset = ("NO_COLOR", "COLUMNS", "LINES", "FORCE_COLOR")
    surroundings = {name: value for name, value in os.environ.items() if name not in unset}
    popen = subprocess.Popen(
        [sys.executable, "-c", LAUNCH, *arguments],
        stdin=its_side,
        stdout=its_side,
        stderr=its_side,
        start_new_session=True,
        env={**surroundings, "TERM": "xterm-256color", **(environment or {})},
    )
    os.close(its_side)
    try:
        yield Terminal(popen, own_side, size)
    finally:
        if popen.poll() is None:
            popen.kill()
        popen.wait(STOP_LIMIT)
        os.close(own_side)
