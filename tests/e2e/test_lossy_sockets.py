"""One submission, one task: real sockets, a real server, and a net that loses, doubles, reorders.

``tests/scenarios/test_exactly_once.py`` is the same in the virtual world, and larger.
"""

import socket
import struct
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from math import inf, radians
from pathlib import Path
from random import Random
from selectors import EVENT_READ, DefaultSelector
from time import monotonic
from typing import Protocol

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.goal import Goal, Move, Rotate
from mav_tasks.tasks.lifecycle import TaskState
from mav_tasks.tasks.task import Task
from tests.kit.client import (
    ACCEPTED,
    ACK,
    MOVE,
    REPEATS,
    REQUEST,
    ROTATE,
    TASK_QUEUE_STATUS,
    TASK_STATUS,
    TEMPORARILY_REJECTED,
    Message,
    Received,
    TaskStatus,
    command_long,
)
from tests.kit.lossy_udp import LossyUdp, lossy_udp
from tests.kit.processes import Stand, stand, wait_for

TERRIBLE = Conditions(loss=0.3, duplication=0.3, delay=0.002, jitter=0.12)
COMMANDS = (MOVE, ROTATE)
CLIENTS, EACH = 10, 50
AGAIN = 0.06  # s between the copies of one submission: several of them are on their way at once
REPEATERS = 20
PATIENCE = 2.0  # s, after which MAVSDK does not wait for an answer any more
IN_TIME = 0.3  # s; a copy later than that is one that MAVSDK would not send
LATER = 3600.0  # s of start delay: nothing is driven meanwhile
WITHIN = 60.0  # s for all to be done, on a very busy machine
MAX_DATAGRAM = 2048


class Endpoint:
    """A client's socket, and the numbering of its packets."""

    def __init__(self, port: int, system_id: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.connect(("127.0.0.1", port))
        self.system_id = system_id
        self._mav = common.MAVLink(None, system_id, 190)
        self._decoder = common.MAVLink(None)

    def __repr__(self) -> str:
        return f"Endpoint({self.system_id})"

    def send(self, message: Message) -> None:
        """Send it under the next sequence number."""
        self.socket.send(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256

    def receive(self) -> Iterator[Received]:
        """Yield the packets that have come: each is a datagram of its own."""
        while True:
            try:
                yield Received(monotonic(), self.socket.recv(MAX_DATAGRAM))
            except BlockingIOError:
                return

    def decoded(self, packet: Received) -> Message:
        return self._decoder.decode(bytearray(packet.raw))


class Client(Protocol):
    """Whoever is given a turn whenever something comes or its time has, until it is done."""

    @property
    def endpoint(self) -> Endpoint: ...
    @property
    def is_done(self) -> bool: ...
    def turn(self, now: float) -> None: ...
    def next_deadline(self) -> float: ...


@dataclass
class Lane:
    """Submissions of one command, one after the other: an ack names no more than the command."""

    command: int
    left: list[int] = field(repr=False)  # nonces
    nonce: int = 0  # under way; 0: none
    next_at: float = 0.0


@dataclass
class Submitter:
    """Sends each submission until both an ack and a status have told it which task that is.

    An ack alone may be a late one, of an earlier submission of the same command. What counts is
    the status, which names the nonce.
    """

    endpoint: Endpoint
    lanes: list[Lane]
    told: dict[int, int] = field(default_factory=dict, repr=False)  # nonce -> task
    acked: set[int] = field(default_factory=set, repr=False)  # tasks
    refused: set[tuple[int, int]] = field(default_factory=set)  # (result, reason)

    def turn(self, now: float) -> None:
        for packet in self.endpoint.receive():
            self._read(packet)
        for lane in self.lanes:
            if self.told.get(lane.nonce) in self.acked:
                lane.nonce = 0
            if not lane.nonce and lane.left:
                lane.nonce, lane.next_at = lane.left.pop(), now
            if lane.nonce and now >= lane.next_at:
                lane.next_at = now + AGAIN
                value = 1 + lane.nonce % 7  # many ask for the very same
                params = (value, 0, 0, lane.nonce, 0, LATER, 5)
                self.endpoint.send(command_long(lane.command, *params))

    def _read(self, packet: Received) -> None:
        if packet.message_id == TASK_STATUS:
            status = TaskStatus.of(packet.payload)
            first = self.told.setdefault(status.nonce, status.task_id)
            assert status.task_id == first, f"one submission is two tasks: {first} and {status}"
        elif packet.message_id == ACK:
            ack = self.endpoint.decoded(packet)
            if ack.result == ACCEPTED:
                self.acked.add(ack.result_param2)
            else:  # as when the disk was too slow: it is sent again all the same
                self.refused.add((ack.result, ack.result_param2))

    def next_deadline(self) -> float:
        return min((lane.next_at for lane in self.lanes if lane.nonce), default=inf)

    @property
    def is_done(self) -> bool:
        return not any(lane.nonce or lane.left for lane in self.lanes)


@dataclass
class Repeater:
    """Sends one submission of each command, as MAVSDK does: until it is acked, or given up."""

    endpoint: Endpoint
    value: float
    began: float
    due: dict[int, list[float]] = field(
        default_factory=lambda: {command: list(REPEATS) for command in COMMANDS}
    )
    acked: dict[int, set[int]] = field(default_factory=dict)  # command -> tasks
    copies: int = 0

    def turn(self, now: float) -> None:
        for packet in self.endpoint.receive():
            if packet.message_id == ACK:
                ack = self.endpoint.decoded(packet)
                self.due[ack.command].clear()
                if ack.result == ACCEPTED:
                    self.acked.setdefault(ack.command, set()).add(ack.result_param2)
        for command, due in self.due.items():
            while due and now >= self.began + due[0]:
                if now < self.began + due.pop(0) + IN_TIME:
                    params = (self.value, 0, 0, 0, 0, LATER, 5)
                    self.endpoint.send(command_long(command, *params))
                    self.copies += 1

    def next_deadline(self) -> float:
        return self.began + min((due[0] for due in self.due.values() if due), default=PATIENCE)

    def goal(self, command: int) -> Goal:
        """What its submission of a command asks for."""
        return Move(self.value) if command == MOVE else Rotate(radians(self.value))

    @property
    def is_done(self) -> bool:
        is_answered = len(self.acked) == len(COMMANDS)
        return is_answered or monotonic() >= self.began + PATIENCE


def run(clients: Sequence[Client]) -> None:
    """Return the clients their turns until all are done."""
    end = monotonic() + WITHIN
    with DefaultSelector() as selector:
        for client in clients:
            selector.register(client.endpoint.socket, EVENT_READ)
        while under_way := [client for client in clients if not client.is_done]:
            now = monotonic()
            assert now < end, f"not done in {WITHIN} s: {under_way}"
            for client in clients:
                client.turn(now)
            due = min(client.next_deadline() for client in under_way)
            selector.select(max(min(due, end) - monotonic(), 0.0))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def running(tmp_path: Path, path: Path) -> Iterator[Stand]:
    with stand(tmp_path, "--store", str(path)) as it:
        yield it


def counts(running: Stand) -> dict[TaskState, int]:
    """How many tasks are in which state, as the server says; asked past the proxy.

    All that was delivered to the server before has been seen to by then: it is one socket.
    """
    link = running.connect()
    link.mav.command_long_send(1, 191, REQUEST, 0, TASK_QUEUE_STATUS, 0, 0, 0, 0, 0, 0)
    message = wait_for(link, f"UNKNOWN_{TASK_QUEUE_STATUS}")
    payload = bytes(message.get_msgbuf()[10:-2]).ljust(78, b"\0")
    of_states = struct.unpack_from("<14I", payload, 20)
    return {TaskState(state): count for state, count in enumerate(of_states) if count}


def end_and_read(running: Stand, path: Path) -> tuple[Task, ...]:
    """The tasks that the store holds after an orderly end."""
    running.server.end()
    assert running.server.popen.returncode == 0
    assert "Traceback" not in running.server.text
    with closing(SqliteStore(path, wall_offset=lambda: 0.0)) as store:
        return store.load().tasks


def was_terrible(proxy: LossyUdp) -> bool:
    """Whether the net was as bad as it should be, both ways."""
    return all(
        min(way.lost, way.doubled, way.overtaken) > way.came / 100
        for way in (proxy.to_server, proxy.to_clients)
    )


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_500_submissions_with_nonces_are_500_tasks(running: Stand, path: Path) -> None:
    # The same nonces from every client: a nonce is its client's own.
    nonces = Random(0).sample(range(1, 1 << 24), EACH)
    with ExitStack() as open_, lossy_udp(running.client_port, TERRIBLE, seed=1) as proxy:
        submitters = []
        for number in range(CLIENTS):
            endpoint = Endpoint(proxy.port, 100 + number)
            open_.enter_context(endpoint.socket)
            lanes = [Lane(MOVE, nonces[::2]), Lane(ROTATE, nonces[1::2])]
            submitters.append(Submitter(endpoint, lanes))
        run(submitters)
    assert was_terrible(proxy), proxy
    counted = counts(running)
    tasks = end_and_read(running, path)

    assert counted == {TaskState.SCHEDULED: CLIENTS * EACH}
    assert len(tasks) == CLIENTS * EACH
    assert len({task.id for task in tasks}) == CLIENTS * EACH
    assert len({task.submitter.endpoint for task in tasks}) == CLIENTS
    for submitter in submitters:
        system_id = submitter.endpoint.system_id
        own = {t.marks.nonce: t.id for t in tasks if t.submitter.system_id == system_id}
        assert set(own) == set(nonces)
        assert submitter.told == own
        assert submitter.acked == set(own.values())
        assert {result for result, _ in submitter.refused} <= {TEMPORARILY_REJECTED}


def test_without_nonces_who_repeats_as_mavsdk_does_gets_one_task_for_each(
    running: Stand, path: Path
) -> None:
    with ExitStack() as open_, lossy_udp(running.client_port, TERRIBLE, seed=2) as proxy:
        repeaters = []
        for number in range(REPEATERS):
            endpoint = Endpoint(proxy.port, 245)  # as every MAVSDK: the endpoint tells them apart
            open_.enter_context(endpoint.socket)
            repeaters.append(Repeater(endpoint, 1 + number, began=monotonic()))
        run(repeaters)
    counted = counts(running)
    tasks = end_and_read(running, path)

    submissions = REPEATERS * len(COMMANDS)
    assert sum(repeater.copies for repeater in repeaters) > submissions, "nothing was repeated"
    assert counted == {TaskState.SCHEDULED: len(tasks)}
    assert len({(task.command, task.goal) for task in tasks}) == len(tasks) <= submissions
    goals: dict[int, Goal] = {task.id: task.goal for task in tasks}
    told = [
        (goals[task_id], repeater.goal(command))
        for repeater in repeaters
        for command, ids in repeater.acked.items()
        for task_id in ids
    ]
    assert all(task == meant for task, meant in told)
    # All four copies, or the answers to them, may be lost: then nothing was promised.
    assert submissions / 2 < len(told) <= len(tasks)
