"""Exactly one task per submission, over real sockets and a net that loses, doubles and reorders."""

import selectors
import socket
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import common

from tests.kit.client import ACK, MOVE, TASK_STATUS, Received, TaskStatus, command_long, heartbeat
from tests.kit.lossy_net import HOST, LossyNet
from tests.kit.processes import Stand, stand

CLIENTS, EACH = 10, 50
OUTSTANDING = 5
AGAIN = 0.2  # s, until a submission of which nothing is known yet is sent again
LATER = 3600.0  # s of start delay: nothing is driven
LIMIT = 120.0  # s, for everything
MAVSDK_REPEATS = (0.0, 0.5, 1.0, 1.5)  # s: the same payload, confirmation 0, another seq
HEARD_IN_TIME = 0.30**4  # that all four copies are lost: such a submission becomes no task


@dataclass
class Client:
    """A script with a socket of its own."""

    number: int
    port: int
    ids: dict[int, int] = field(default_factory=dict)  # nonce -> task id
    acked: list[int] = field(default_factory=list)  # result_param2 of what was accepted

    def __post_init__(self) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.setblocking(False)
        self.sock.connect((HOST, self.port))
        self._mav = common.MAVLink(None, 245, 190)
        self._decoder = common.MAVLink(None)

    def send(self, message: common.MAVLink_message) -> None:
        self.sock.send(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256

    def submit(self, distance: float, *, nonce: int) -> None:
        self.send(command_long(MOVE, distance, 0, 0, nonce, 0, LATER, 5))

    def receive(self) -> None:
        while True:
            try:
                packet = Received(0.0, self.sock.recv(2048))
            except BlockingIOError:
                return
            if packet.message_id == TASK_STATUS:
                status = TaskStatus.of(packet.payload)
                if status.nonce:
                    assert self.ids.setdefault(status.nonce, status.task_id) == status.task_id
            elif packet.message_id == ACK:
                ack = self._decoder.decode(bytearray(packet.raw))
                assert ack.result == 0, ack
                self.acked.append(ack.result_param2)


@contextmanager
def clients(port: int, count: int) -> Iterator[list[Client]]:
    made = [Client(number, port) for number in range(count)]
    try:
        yield made
    finally:
        for client in made:
            client.sock.close()


def receive_all(made: list[Client], *, within: float) -> None:
    """Wait until something has come for somebody, and take it in."""
    with selectors.DefaultSelector() as selector:
        for client in made:
            selector.register(client.sock, selectors.EVENT_READ, client)
        for key, _ in selector.select(within):
            key.data.receive()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def running(tmp_path: Path, path: Path) -> Iterator[Stand]:
    with stand(tmp_path, "--store", str(path)) as it:
        yield it


def stored(path: Path) -> list[int]:
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as connection:
        return [row[0] for row in connection.execute("SELECT id FROM tasks ORDER BY id")]


def test_five_hundred_submissions_with_nonces(running: Stand, path: Path) -> None:
    net = LossyNet(running.client_port, loss=0.3, doubling=0.3, seed=7)
    with net, clients(net.port, CLIENTS) as made:
        _submit_all(made)
    assert net.lost > 100
    assert net.doubled > 100

    running.server.end()

    ids = [task_id for client in made for task_id in client.ids.values()]
    assert len(ids) == CLIENTS * EACH
    assert sorted(ids) == stored(path)
    for client in made:
        assert set(client.acked) <= set(client.ids.values()), "another's acknowledgement"


def _submit_all(made: list[Client]) -> None:
    """Each keeps a few submissions outstanding and repeats them until it has read their ids."""
    sent_at: list[dict[int, float]] = [{} for _ in made]
    heartbeat_at, end = 0.0, time.monotonic() + LIMIT
    while any(len(client.ids) < EACH for client in made):
        now = time.monotonic()
        assert now < end, [len(client.ids) for client in made]
        if now >= heartbeat_at:
            heartbeat_at = now + 0.5
            for client in made:
                client.send(heartbeat())
        for client, sent in zip(made, sent_at, strict=True):
            first = client.number * EACH + 1
            missing = [n for n in range(first, first + EACH) if n not in client.ids]
            for nonce in missing[:OUTSTANDING]:
                if now - sent.get(nonce, -1.0) >= AGAIN:
                    sent[nonce] = now
                    client.submit(1.0 + nonce / 8, nonce=nonce)
        receive_all(made, within=0.05)


def test_repeated_as_mavsdk_repeats_each_is_one_task(running: Stand, path: Path) -> None:
    net = LossyNet(running.client_port, loss=0.3, doubling=0.3, seed=11)
    rounds, count = 4, 10
    with net, clients(net.port, count) as made:
        for number in range(rounds):
            _repeat(made, distance=float(number + 1))
        _listen(made, seconds=1.0)

    running.server.end()

    ids = stored(path)
    expected = rounds * count * (1 - HEARD_IN_TIME)
    assert expected - 3 <= len(ids) <= rounds * count
    acked = [set(client.acked) for client in made]
    assert sum(map(len, acked)) == len(set().union(*acked)), "two clients got the same id"
    assert set().union(*acked) <= set(ids)


def _repeat(made: list[Client], *, distance: float) -> None:
    """Each submits once, and again until it is acknowledged or tired of it."""
    before = [set(client.acked) for client in made]
    began = time.monotonic()
    for at in MAVSDK_REPEATS:
        _listen(made, seconds=began + at - time.monotonic())
        for client, known in zip(made, before, strict=True):
            if set(client.acked) <= known:
                client.send(heartbeat())
                client.submit(distance, nonce=0)
    _listen(made, seconds=0.5)


def _listen(made: list[Client], *, seconds: float) -> None:
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        receive_all(made, within=left)
