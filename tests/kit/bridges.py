"""Bridges a rover's UDP port to TCP, as an ArduPilot SITL has it, or to a serial line."""

import os
import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Event, Lock, Thread
from time import monotonic
from typing import Protocol

from tests.kit.lines import Device

LOOPBACK = "127.0.0.1"
TICK = 0.05  # s between two checks for a changed far end
END_LIMIT = 10.0  # s
MAGIC, HEADER, CRC = 0xFD, 10, 2
SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED


class Far(Protocol):
    """The end that the server connects to."""

    url: str

    def descriptor(self) -> int | None:
        """Return the descriptor of the connection, or None without one."""
        ...

    def cut(self) -> None:
        """Break the connection."""
        ...

    def mend(self) -> None:
        """Permit connections again."""
        ...


class TcpFar:
    """Listens, for one connection at a time."""

    def __init__(self) -> None:
        self._port = 0
        self._accepted: socket.socket | None = None
        self._listening: socket.socket | None = None
        self.mend()

    @property
    def url(self) -> str:
        """The server's URL for it."""
        return f"tcp:{LOOPBACK}:{self._port}"

    def descriptor(self) -> int | None:
        """Return the latest connection."""
        if self._listening is not None and select.select([self._listening], [], [], 0.0)[0]:
            if self._accepted is not None:
                self._accepted.close()
            self._accepted, _ = self._listening.accept()
            self._accepted.setblocking(False)
        return None if self._accepted is None else self._accepted.fileno()

    def cut(self) -> None:
        """Close the connection and stop listening."""
        for each in (self._accepted, self._listening):
            if each is not None:
                each.close()
        self._accepted = self._listening = None

    def mend(self) -> None:
        """Listen again."""
        self._listening = socket.create_server((LOOPBACK, self._port))
        self._port = self._listening.getsockname()[1]


class SerialFar:
    """A serial device that can be plugged and unplugged."""

    def __init__(self, path: Path, *, baud: int) -> None:
        self._device = Device(path)
        self.url = f"serial:{path}:{baud}"

    def descriptor(self) -> int | None:
        """Return the far end of the line."""
        return self._device.far if self._device.far >= 0 else None

    def cut(self) -> None:
        """Unplug the device."""
        self._device.unplug()

    def mend(self) -> None:
        """Plug the device in again."""
        self._device.plug()


class Bridge:
    """Passes packets between a rover's UDP port and ``far``.

    It splits the server's bytes into packets by their lengths alone: they must be whole packets
    without anything in between.
    """

    def __init__(self, rover_port: int, far: Far) -> None:
        self.setpoints: list[float] = []  # monotonic times of arrival
        self.broken: list[bytes] = []  # bytes where a packet should begin
        self._far = far
        self._lock = Lock()
        self._rover = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._rover.connect((LOOPBACK, rover_port))
        self._rover.setblocking(False)
        self._buffer = b""
        self._is_over = Event()
        self._thread = Thread(target=self._run, name="bridge", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """The server's URL for the rover."""
        return self._far.url

    def cut(self) -> None:
        """Disconnect the server from the rover."""
        with self._lock:
            self._far.cut()
            self._buffer = b""

    def mend(self) -> None:
        """Permit the connection again."""
        with self._lock:
            self._far.mend()

    def close(self) -> None:
        """End the bridge; fail if bytes were broken."""
        self._is_over.set()
        self._thread.join(END_LIMIT)
        assert not self._thread.is_alive()
        self._far.cut()
        self._rover.close()
        assert self.broken == []

    def _run(self) -> None:
        while not self._is_over.is_set():
            with self._lock:
                far = self._far.descriptor()
                there = [self._rover.fileno(), *([] if far is None else [far])]
            ready: list[int] = []
            with suppress(OSError):  # cut during the wait
                ready = select.select(there, [], [], TICK if far is not None else 0.01)[0]
            with self._lock, suppress(OSError):
                if self._far.descriptor() != far:
                    self._buffer = b""
                    continue
                if far in ready and far is not None:
                    self._to_rover(os.read(far, 4096))
                if self._rover.fileno() in ready:
                    data = self._rover.recv(4096)
                    if far is not None:
                        os.write(far, data)

    def _to_rover(self, data: bytes) -> None:
        self._buffer += data
        while len(self._buffer) >= HEADER:
            end = HEADER + self._buffer[1] + CRC
            if self._buffer[0] != MAGIC:
                self.broken.append(self._buffer)
                self._buffer = b""
                return
            if len(self._buffer) < end:
                return
            packet, self._buffer = self._buffer[:end], self._buffer[end:]
            if packet[7] == SETPOINT:
                self.setpoints.append(monotonic())
            self._rover.send(packet)


@contextmanager
def bridge(rover_port: int, far: Far) -> Iterator[Bridge]:
    """Run a bridge for a ``with`` block."""
    made = Bridge(rover_port, far)
    try:
        yield made
    finally:
        made.close()
