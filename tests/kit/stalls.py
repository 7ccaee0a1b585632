"""Detects stalls of the machine: a small process beside the tests only sleeps and checks the time.

Run as a program, it writes a line for each time it was kept from running, until its parent ends.
"""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from time import monotonic, sleep

STALL = 0.25  # s; half of watch.late_tick, after which a server holds its tasks
PERIOD = 0.02  # s


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
    while os.getppid() == parent:
        sleep(PERIOD)
        now = monotonic()
        if now - last > STALL:
            print(last, now, flush=True)
        last = now


if __name__ == "__main__":
    watch()
