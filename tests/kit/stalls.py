"""Detects stalls of the machine and of its disk, with a small process beside the tests.

It sleeps, sometimes writes to the disk, and checks the time. Run as a program, it writes a line for
each time that this took too long, until its parent ends.
"""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from itertools import count
from tempfile import TemporaryFile
from time import monotonic, sleep

#: s; a server holds its tasks after watch.late_tick, 0.5 s, and refuses new ones if the disk takes
#: watch.commit, 0.4 s
STALL = 0.25
PERIOD = 0.02  # s
DISK = 10  # periods between two writes to the disk


@dataclass(frozen=True)
class Stall:
    """Begin and end in monotonic seconds, which all processes of a machine share."""

    begin: float
    end: float


@dataclass
class StallWatch:
    """Records the stalls since its creation."""

    stalls: list[Stall] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._watcher = subprocess.Popen(
            [sys.executable, "-I", "-S", __file__], stdout=subprocess.PIPE
        )
        assert self._watcher.stdout is not None
        self._watcher.stdout.readline()  # it has started
        self._told = self._watcher.stdout.fileno()
        os.set_blocking(self._told, False)
        self._rest = b""

    @property
    def pid(self) -> int:
        """The watcher's process id."""
        return self._watcher.pid

    def since(self, begin: float) -> list[Stall]:
        """Return the stalls that ended after ``begin``."""
        sleep(3 * PERIOD)  # the watcher reports a stall only after its end
        self._read()
        return [stall for stall in self.stalls if stall.end > begin]

    def close(self) -> None:
        """End the watcher."""
        self._watcher.kill()
        self._watcher.wait()
        assert self._watcher.stdout is not None
        self._watcher.stdout.close()

    def _read(self) -> None:
        while True:
            try:
                told = os.read(self._told, 65_536)
            except BlockingIOError:
                return
            if not told:
                raise RuntimeError("who watches for stalls has ended")
            *lines, self._rest = (self._rest + told).split(b"\n")
            self.stalls += [Stall(*map(float, line.split())) for line in lines]


def watch() -> None:
    """Write an empty line, then begin and end of each stall, until the parent ends."""
    parent, last = os.getppid(), monotonic()
    print(flush=True)
    with TemporaryFile() as file:  # where the tests have their files
        for number in count():
            sleep(PERIOD)
            if number % DISK == 0:
                os.pwrite(file.fileno(), b".", 0)
                os.fsync(file.fileno())
            now = monotonic()
            if now - last > STALL:
                print(last, now, flush=True)
            last = now
            if os.getppid() != parent:
                return


if __name__ == "__main__":
    watch()
