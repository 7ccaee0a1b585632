"""Sockets that speak MAVLink on loopback: a client, rovers by script, and what they time.

A client packs everything beforehand, and reads only the id of an answer.
"""

import math
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from time import monotonic, perf_counter, sleep
from typing import Self

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavResult, MavState, MavType
from mav_tasks.mavlink.packet import split_datagram

from .processes import HOST, Process, server

CLIENT = Address(245, 190)
BEAT = 0.5  # s between two heartbeats
MEET_WITHIN = 5.0  # s
QUIET = 0.3  # s without a request: the server has completed its requests
PATIENCE = 0.3  # s without an answer, after which packets under way count as lost
OUTSTANDING = 64
STATION = m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
#: in HOLD, disarmed
STANDING = m.Heartbeat(MavType.GROUND_ROVER, MavAutopilot.ARDUPILOTMEGA, 1, 4, MavState.STANDBY, 3)


def command(number: int, *params: float, rover: int = 1) -> m.CommandLong:
    """Return a command to the server; missing parameters are 0."""
    return m.CommandLong(rover, 191, number, 0, *(*params, *(0.0,) * 7)[:7])


STOP = command(MavCmd.TASK_STOP)


def move(nonce: int, distance: float = 1.0, *, rover: int = 1) -> m.CommandLong:
    """Return the submission of a task."""
    return command(MavCmd.TASK_MOVE, distance, 0, 0, nonce, 0, 0, 5, rover=rover)


class Speaker:
    """A socket, and the packets of one MAVLink address."""

    def __init__(self, address: Address = CLIENT, *, to: int = 0) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self.socket.bind((HOST, 0))
        self.socket.settimeout(1.0)
        if to:
            self.socket.connect((HOST, to))
        self.port: int = self.socket.getsockname()[1]
        self.encode = Encoder(address).encode
        self._next_beat = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, message: m.Message) -> None:
        """Send a message to where the socket is connected."""
        self.socket.send(self.encode(message))

    def beat(self, message: m.Message = STATION) -> None:
        """Send a heartbeat if one is due."""
        if monotonic() >= self._next_beat:
            self._next_beat = monotonic() + BEAT
            self.send(message)

    def drain(self) -> list[bytes]:
        """Return the datagrams that have come."""
        found = []
        self.socket.settimeout(0.0)
        with suppress(BlockingIOError):
            while True:
                found.append(self.socket.recv(2048))
        self.socket.settimeout(1.0)
        return found


class Rovers(Speaker):
    """Disarmed rovers on one socket: they accept every command, and execute none."""

    def __init__(self) -> None:
        super().__init__(Address(1, 1))

    def meet(self, client: Speaker) -> None:
        """Make rover and client known to a server, and wait until its requests end."""
        self.connect()
        end = monotonic() + MEET_WITHIN
        with suppress(TimeoutError):
            while monotonic() < end:
                self.socket.settimeout(QUIET)
                self.answer(self.socket.recv(2048))
        client.send(STATION)
        client.socket.recv(2048)  # the rover's heartbeat, with which the server introduces it

    def connect(self) -> None:
        """Wait until the server speaks first; speak with it only from now on."""
        self.socket.settimeout(10 * MEET_WITHIN)
        data, address = self.socket.recvfrom(2048)
        self.socket.connect(address)
        self.answer(data)

    def answer(self, data: bytes) -> list[m.Message]:
        """Answer heartbeats and commands in a datagram; return what was in it."""
        found = [Decoder().decode(packet) for packet in split_datagram(data)]
        for message in found:
            if isinstance(message, m.CommandLong):
                rover = Encoder(Address(message.target_system, 1))
                accepted = m.CommandAck(message.command, MavResult.ACCEPTED)
                self.socket.send(rover.encode(accepted))
            elif isinstance(message, m.Heartbeat):
                self.send(STANDING)
        return [message for message in found if message is not None]

    def live(self) -> None:
        """Send a heartbeat if one is due."""
        self.beat(STANDING)


@contextmanager
def introduced(
    tree: Path, *options: str, is_limited: bool = False
) -> Iterator[tuple[Process, Speaker, Rovers]]:
    """Run a server for a ``with`` block; yield it, with a client and a rover that it knows."""
    with (
        Rovers() as rover,
        server(tree, rover.port, *options, is_limited=is_limited) as it,
        Speaker(to=it.port) as client,
    ):
        rover.meet(client)
        yield it, client, rover


def effect(
    client: Speaker, packet: bytes, message_id: int, *, at: Speaker, within: float = 1.0
) -> float:
    """Return the seconds from sending to a message's arrival; infinity if it does not come."""
    at.socket.settimeout(within)
    receive = at.socket.recv
    start = perf_counter()
    client.socket.send(packet)
    with suppress(TimeoutError):
        while receive(512)[7] != message_id:
            pass
        return perf_counter() - start
    return math.inf


def rate(
    out: Speaker,
    back: Speaker,
    packets: Iterable[bytes],
    is_answer: Callable[[bytes], bool],
    live: Callable[[], None] = lambda: None,
) -> float:
    """Return the answers per second with OUTSTANDING packets under way; tell of losses."""
    supply = iter(packets)
    answered = lost = under_way = 0
    back.socket.settimeout(PATIENCE)
    send, receive = out.socket.send, back.socket.recv
    start = monotonic()
    while True:
        for packet in islice(supply, OUTSTANDING - under_way):
            send(packet)
            under_way += 1
        if not under_way:
            break
        try:
            if not is_answer(receive(512)):
                continue
            answered += 1
            under_way -= 1
            if answered % 512 == 0:
                live()
        except TimeoutError:
            lost += under_way
            under_way = 0
            start += PATIENCE
    if lost:
        print(f"{lost} of {answered + lost} were lost", flush=True)
    return answered / (monotonic() - start)


def stops(
    ask: Callable[[], float], *, seconds: float = math.inf, count: int = 10**6, apart: float = 0.01
) -> tuple[list[float], int]:
    """Ask again and again; return the seconds of what had its effect, and how many were lost."""
    found: list[float] = []
    end = monotonic() + seconds
    while len(found) < count and monotonic() < end:
        found.append(ask())
        sleep(apart)
    return [each for each in found if each < math.inf], found.count(math.inf)
