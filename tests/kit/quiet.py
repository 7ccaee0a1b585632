"""A world whose rover sends only heartbeats, for traffic between clients and server.

It is cheap enough for many seeds.
"""

from collections.abc import Callable

from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import CLIENT_LINK, VEHICLE_LINK, InMemoryServer
from mav_tasks.links.memory import Conditions, MemoryLink, MemoryNet
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.task import Task
from rover_sim.virtual import VirtualWorld
from tests.kit.client import FakeClient
from tests.kit.mission import COUNT, MISSION_ACK, REQUEST, REQUEST_INT, Ack

ROVER = "rover1"


class QuietWorld(VirtualWorld):
    """A server, a rover that sends only heartbeats, and clients; tests can degrade the net."""

    def __init__(self, *, seed: int) -> None:
        self.seed = seed
        self.wire = Wire(seed=seed, conditions=Conditions())
        super().__init__(self.wire)
        self.store = MemoryStore()
        self.join(Beacon(self.wire))
        self.server = InMemoryServer(self.net, vehicles=(ROVER,), store=self.store)
        self.join(self.server)
        self.client = self.add_client("client")
        self.until(lambda: self.server.engine.snapshot(now=self.now).vehicles, within=5)

    def add_client(self, name: str) -> FakeClient:
        """Add another client."""
        client = FakeClient(self.net, name)
        self.join(client)
        return client

    def tasks(self) -> tuple[Task, ...]:
        """Return every task of the server."""
        return self.server.engine.snapshot(now=self.now).tasks

    def until(self, condition: Callable[[], object], *, within: float) -> None:
        """Let time pass until the condition holds. Raise AssertionError if it does not."""
        came = self.run_until(lambda: bool(condition()), within=within)
        assert came, f"not within {within} s (seed {self.seed}, t={self.now:.2f})"


class Wire(MemoryNet):
    """A net that records the traffic of uploads: requests, counts and acks."""

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        #: (client, item) per request of the server; item None: a client's count arrived
        self.asked: list[tuple[str, int | None]] = []
        #: (client, ack) per ack of the server, whether it arrived or not
        self.acks: list[tuple[str, Ack]] = []
        self._newest: dict[str, int] = {}

    def send(self, source: str, target: str, data: bytes) -> None:
        """Record the server's requests and acks."""
        if source == CLIENT_LINK and (_is(data, REQUEST) or _is(data, REQUEST_INT)):
            self.asked.append((target, int.from_bytes(_payload(data)[:2], "little")))
        elif source == CLIENT_LINK and _is(data, MISSION_ACK):
            self.acks.append((target, Ack.of(_payload(data))))
        super().send(source, target, data)

    def arrive(self, link: MemoryLink, source: str, data: bytes) -> None:
        """Record a count that is newer than all packets before."""
        if link.name == CLIENT_LINK:
            newest = self._newest.get(source)
            if newest is None or (data[4] - newest) % 256 < 128:
                self._newest[source] = data[4]
                if _is(data, COUNT):
                    self.asked.append((source, None))
        super().arrive(link, source, data)


def _is(data: bytes, message_id: int) -> bool:
    return int.from_bytes(data[7:10], "little") == message_id


def _payload(data: bytes) -> bytes:
    return data[10 : 10 + data[1]].ljust(9, b"\0")


class Beacon:
    """A rover that sends only heartbeats."""

    def __init__(self, net: MemoryNet) -> None:
        self._link = net.link(ROVER)
        self._mav = common.MAVLink(None, 1, 1)
        self._next_at = net.now

    def next_deadline(self) -> float:
        return self._next_at

    def turn(self, *, now: float) -> None:
        self._link.receive(len(self._link.arrived))
        if now >= self._next_at:
            self._next_at = now + 1.0
            beat = common.MAVLink_heartbeat_message(10, 3, 1, 0, 4, 3)
            self._link.send(VEHICLE_LINK, beat.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256
