"""A world whose rover sends only heartbeats, for traffic between clients and server.

It is cheap enough for many seeds.
"""

from collections.abc import Callable

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions, MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK, InMemoryServer
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.task import Task
from rover_sim.virtual import VirtualWorld
from tests.kit.client import FakeClient
from tests.kit.mission import MISSION_ACK, Ack

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
    """A net that records the acks of uploads."""

    def __init__(self, *, seed: int, conditions: Conditions) -> None:
        super().__init__(seed=seed, conditions=conditions)
        #: (client, ack) per ack of the server, whether it arrived or not
        self.acks: list[tuple[str, Ack]] = []

    def send(self, source: str, target: str, data: bytes) -> None:
        """Record the server's acks."""
        if source == CLIENT_LINK and int.from_bytes(data[7:10], "little") == MISSION_ACK:
            self.acks.append((target, Ack.of(data[10 : 10 + data[1]].ljust(9, b"\0"))))
        super().send(source, target, data)


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
