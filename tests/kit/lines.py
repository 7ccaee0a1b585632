"""Serial lines made of pseudo-terminals: a device that can be unplugged, and a slow line."""

import os
import selectors
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Thread
from time import monotonic

BITS = 10  # per byte on the line
TICK = 0.01  # s
END_LIMIT = 10.0  # s


class Device:
    """A serial device at ``path``, and the descriptor of the far end of its line.

    A device that is plugged in again has the same path, as with a udev rule for an adapter.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.far = -1
        self._near = -1
        self.plug()

    def plug(self) -> None:
        """Plug the device in."""
        self.far, self._near = os.openpty()
        tty.setraw(self._near)
        os.set_blocking(self.far, False)
        self.path.symlink_to(os.ttyname(self._near))

    def unplug(self) -> None:
        """Unplug the device; the system reports it to processes that have it open."""
        if self.far < 0:
            return
        self.path.unlink()
        os.close(self._near)
        os.close(self.far)
        self.far = self._near = -1


@contextmanager
def device(path: Path) -> Iterator[Device]:
    """Plug a device in for a ``with`` block."""
    made = Device(path)
    try:
        yield made
    finally:
        made.unplug()


class SlowLine:
    """Two devices joined by a line with a limited rate; excess bytes wait in the devices.

    A pseudo-terminal does not report bytes in transit: it accepts bytes until it is full.
    """

    def __init__(self, one: Device, other: Device, *, baud: int) -> None:
        self._ways = ((one.far, other.far), (other.far, one.far))
        self._rate = baud / BITS
        self.passed = [0, 0]  # bytes, in each direction
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="slow line", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop forwarding."""
        self._is_over.set()
        self._thread.join(END_LIMIT)
        assert not self._thread.is_alive()

    def _run(self) -> None:
        at, due = monotonic(), [0.0, 0.0]
        while not self._is_over.wait(TICK):
            passed, at = monotonic() - at, monotonic()
            for number, (source, target) in enumerate(self._ways):
                due[number] = min(due[number] + passed * self._rate, 2 * TICK * self._rate)
                with suppress(BlockingIOError):
                    data = os.read(source, int(due[number])) if due[number] >= 1 else b""
                    due[number] -= len(data)
                    self.passed[number] += len(data)
                    while data:
                        data = data[os.write(target, data) :]


@contextmanager
def slow_line(folder: Path, *, baud: int) -> Iterator[tuple[Path, Path]]:
    """Return the paths of two devices that are joined for a ``with`` block."""
    with device(folder / "ttyOne") as one, device(folder / "ttyOther") as other:
        line = SlowLine(one, other, baud=baud)
        try:
            yield one.path, other.path
        finally:
            line.close()


def read_from(descriptor: int, count: int, *, within: float = END_LIMIT) -> bytes:
    """Return ``count`` bytes of a descriptor. Raise AssertionError if they are late."""
    data, end = b"", monotonic() + within
    with selectors.DefaultSelector() as selector:
        selector.register(descriptor, selectors.EVENT_READ)
        while len(data) < count:
            assert selector.select(max(0.0, end - monotonic())), f"only {data!r}"
            data += os.read(descriptor, count - len(data))
    return data
