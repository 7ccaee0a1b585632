"""A program at a terminal of a given size, with an emulator of its screen."""

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
#: makes it the controlling terminal, so that Ctrl-C and resizing work as in a shell
LAUNCH = (
    "import fcntl, os, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0);"
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)


class Terminal:
    """A running program with its screen; ``written`` has all raw bytes of its output."""

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
        """The screen's lines, without trailing blanks and trailing empty lines."""
        lines = [str(line).rstrip() for line in self._screen.display]
        while lines and not lines[-1]:
            del lines[-1]
        return lines

    @property
    def text(self) -> str:
        """The screen as one text."""
        return "\n".join(self.lines)

    def wait_for(self, condition: Callable[[str], object], *, within: float = 60.0) -> None:
        """Wait until the screen's text meets a condition."""
        end = time.monotonic() + within
        while not condition(self.text):
            assert time.monotonic() < end, f"not in {within} s on:\n{self.text}"
            assert self._read(end - time.monotonic()), f"it ended:\n{self.text}"

    def type(self, keys: bytes) -> None:
        """Press keys."""
        os.write(self._own_side, keys)

    def resize(self, rows: int, columns: int) -> None:
        """Resize the window; the system signals the program."""
        self._screen.resize(rows, columns)
        termios.tcsetwinsize(self._own_side, (rows, columns))

    def end(self, *, within: float = 60.0) -> int:
        """Read to the end; return the exit status."""
        end = time.monotonic() + within
        while self._read(end - time.monotonic()):
            assert time.monotonic() < end, f"still there after {within} s:\n{self.text}"
        return self.popen.wait(STOP_LIMIT)

    def _read(self, within: float) -> bool:
        """Read available output within ``within`` seconds; return False at its end."""
        if not select.select([self._own_side], [], [], max(within, 0.0))[0]:
            return True
        data = b""
        with suppress(OSError):  # raised when the other side is closed
            data = os.read(self._own_side, 65536)
        self.written += data
        self._stream.feed(data)
        return bool(data)


@contextmanager
def terminal(
    *arguments: str, size: tuple[int, int] = (24, 80), environment: dict[str, str] | None = None
) -> Iterator[Terminal]:
    """Run Python with these arguments at a terminal of this size (rows, columns)."""
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
