"""A serial line: raw, without flow control, opened exclusively; reopened whenever it is lost.

Not every system and adapter tells how many written bytes the line has yet to send. So this link
estimates them from the baud rate, and writes at most LEAD ahead: a packet that still waits in the
queue can give way to a newer one.
"""

import os
import selectors
import termios
from contextlib import suppress
from dataclasses import dataclass, field
from errno import EIO, ENODEV, ENOENT, ENXIO
from typing import ClassVar

from serial import Serial, SerialException

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import LinkOpenError, LinkUrlError
from mav_tasks.links.attempts import Attempts
from mav_tasks.links.base import Link, Peer, PeerChange, PeerState
from mav_tasks.links.endpoint import number_in
from mav_tasks.links.link_limits import LinkLimits
from mav_tasks.links.out_queue import OutQueue
from mav_tasks.links.url import NO_OPTIONS, UrlOptions

BAUD_RATES = range(1_200, 12_000_001)
PIECE = 280  # bytes read at once, a MAVLink packet
LEAD = 0.1  # s of line time that may be written ahead; two TEND_PERIODs
BITS = 10  # per byte on the line, with a start and a stop bit
USED = 0.9  # part of the nominal baud rate used: on a slightly slower line the backlog would grow
FAILURES = (OSError, ValueError, termios.error)  # pySerial raises these or lets them through
#: the device may be plugged in later; the operator must fix any other error
NOT_THERE = frozenset({ENOENT, ENODEV, ENXIO, EIO})


@dataclass(frozen=True, slots=True)
class SerialUrl:
    """The URL of a serial line: ``serial:device:baud``."""

    can_push: ClassVar[bool] = False  # a line has one other end

    device: str
    baud: int  # bits per second; a byte takes ten
    options: UrlOptions = field(default=NO_OPTIONS, compare=False)

    def __str__(self) -> str:
        return f"serial:{self.device}:{self.baud}"

    @property
    def is_nearby(self) -> bool:
        """Return True: the operator chose the wire.

        The server cannot see a radio at its end; ``?unsigned=refuse``, and ``?key=`` on a link to
        vehicles, are for radios.
        """
        return True

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        assert not push, "only a link that can push gets addresses"
        return SerialLink(self, limits=limits)


def parse(_kind: str, rest: str, options: UrlOptions, *, what: str) -> SerialUrl:
    device, _, baud = rest.rpartition(":")
    if not device or number_in(baud, BAUD_RATES) is None:
        rates = f"from {BAUD_RATES[0]} to {BAUD_RATES[-1]}"
        raise LinkUrlError(f"{what}: expected serial:device:baud with a baud rate {rates}")
    return SerialUrl(device, int(baud), options)


class SerialLink:
    """A serial device as a link with one peer, the device's name."""

    peers: tuple[Peer, ...] = ()
    is_stream = True
    note = ""
    #: the device may be a radio, with anybody at its other end
    is_local = False

    def __init__(self, url: SerialUrl, *, limits: LinkLimits) -> None:
        self.name = str(url)
        self.capacity = url.baud / BITS
        self._url = url
        self._limits = limits
        self._selector = selectors.DefaultSelector()
        self._attempts = Attempts()
        self._changes: list[PeerChange] = []
        self._device: Serial | None = None
        self._queue = OutQueue(max_age=limits.max_age)
        self._free_at = 0.0  # estimated time at which the line has sent the written bytes
        self._lost = 0
        self._attempts.is_due(now=boot_time())
        try:
            self._open()
        except FAILURES as error:
            if _number_of(error) not in NOT_THERE:
                self._selector.close()
                reason = _reason_of(error)
                raise LinkOpenError(f"link {url} cannot be opened: {reason}") from error
            self._note_lost(error)

    def __repr__(self) -> str:
        return f"SerialLink({self.name}, {'up' if self._device else 'down'}, {self._queue})"

    @property
    def lost(self) -> int:
        """Number of packets that were dropped, or had no device."""
        return self._lost + self._queue.dropped

    def fileno(self) -> int:
        return self._selector.fileno()

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` pieces; send waiting packets."""
        received: list[tuple[Peer, bytes]] = []
        while self._device is not None and len(received) < limit and self._selector.select(0):
            try:
                data = os.read(self._device.fd, PIECE)
            except (BlockingIOError, InterruptedError):
                break
            except OSError as error:
                self._lose(error)
                break
            if not data:  # readable without data: the device hung up
                self._lose(OSError(EIO, "hung up"))
                break
            received.append((self._url.device, data))
        self._flush()
        return received

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send or queue a packet; drop it if there is no device."""
        if self._device is None or peer != self._url.device:
            self._lost += 1
            return
        self._queue.put(data, now=boot_time(), first=first)
        self._flush()

    def take_changes(self) -> list[PeerChange]:
        changes, self._changes = self._changes, []
        return changes

    def poll(self) -> None:
        """Send waiting packets and check for congestion, or reopen a lost device."""
        now = boot_time()
        if self._device is None:
            if self._attempts.is_due(now=now):
                try:
                    self._open()
                except FAILURES as error:
                    self._note_lost(error)
            return
        with suppress(OSError):
            self._free_at = max(self._free_at, now + self._time_of(self._device.out_waiting))
        self._flush()
        if self._queue.changed(now=now):
            state = PeerState.CONGESTED if self._queue.is_congested else PeerState.CLEAR
            self._changes.append(PeerChange(self._url.device, state))

    def close(self) -> None:
        """Write waiting packets without blocking, and close the device."""
        if self._device is not None:
            self._write(ahead_until=float("inf"))
        if self._device is not None:
            self._give_back(self._device)
        self._selector.close()

    def _open(self) -> None:
        device = Serial(
            self._url.device,
            self._url.baud,
            timeout=0,
            write_timeout=0,
            xonxoff=False,
            rtscts=False,
            dsrdtr=False,
            exclusive=True,
        )
        self._device = device
        self._lost += self._queue.dropped
        self._queue, self._free_at = OutQueue(max_age=self._limits.max_age), 0.0
        self._selector.register(device.fd, selectors.EVENT_READ)
        words = self._attempts.succeeded()
        self._changes.append(PeerChange(self._url.device, PeerState.UP, words))

    def _flush(self) -> None:
        self._write(ahead_until=boot_time() + LEAD)

    def _write(self, *, ahead_until: float) -> None:
        """Write packets while the line is estimated to be free before ``ahead_until``."""
        while self._device is not None and self._free_at < ahead_until:
            now = boot_time()
            packet = self._queue.next(now=now)
            if not packet:
                return
            try:
                count = os.write(self._device.fd, packet)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self._lose(error)
                return
            self._queue.wrote(count)
            self._free_at = max(self._free_at, now) + self._time_of(count)

    def _time_of(self, count: int) -> float:
        """Return how long the line takes for so many bytes, s."""
        return count * BITS / (USED * self._url.baud)

    def _lose(self, error: OSError) -> None:
        assert self._device is not None
        with suppress(*FAILURES):  # or close would wait for the unsent bytes
            termios.tcflush(self._device.fd, termios.TCOFLUSH)
        self._give_back(self._device)
        self._note_lost(error)

    def _give_back(self, device: Serial) -> None:
        self._selector.unregister(device.fd)
        self._device = None
        with suppress(*FAILURES):
            device.close()

    def _note_lost(self, error: Exception) -> None:
        words = self._attempts.failed(_reason_of(error))
        if words is not None:
            self._changes.append(PeerChange(self._url.device, PeerState.DOWN, words))


def _number_of(error: Exception) -> int | None:
    """Return an error's errno; termios.error has it only in ``args``."""
    if isinstance(error, termios.error):
        return int(error.args[0])
    return error.errno if isinstance(error, OSError) else None


def _reason_of(error: Exception) -> str:
    """Return the system's text for an error, without the texts that pySerial wraps around it.

    pySerial reports a file that is no serial device by an exception without errno.
    """
    if isinstance(error, SerialException):
        if error.errno is None:
            return "it is not a serial device"
        if "exclusively lock" in str(error):
            return "it is in use"
    number = _number_of(error)
    return str(error) if number is None else os.strerror(number)
