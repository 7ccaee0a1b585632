"""A failed engine: nothing but its prepared zero and HOLD leaves, and the server ends with 70.

This stands below the seams for want of another way: nobody knows what makes a real engine fail, so
one that fails is put in its place, and the loop that handles that is the runner's.
"""

import asyncio
import os

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Outgoing, Packets
from mav_tasks.links.base import PeerChange, PeerState
from mav_tasks.runner import Runner
from mav_tasks.settings import Settings
from mav_tasks.store import MemoryStore


class Broken(Engine):
    """An engine that fails at the first packets, with a setpoint not yet sent."""

    def __init__(self) -> None:
        super().__init__(Settings(), now=0.0)
        zero, hold = (Outgoing("stream", "peer", word) for word in (b"zero", b"hold"))
        self.emergency_stop_packets = (zero, hold._replace(is_first=True))
        self.packets: list[Outgoing] = []

    def handle(self, item: object, *, now: float) -> None:
        if isinstance(item, Packets):
            self.packets.append(Outgoing("stream", "peer", b"faster"))
            raise ZeroDivisionError

    def take_packets(self) -> list[Outgoing]:
        packets, self.packets = self.packets, []
        return packets

    def handle_deadline(self, *, now: float) -> None:
        self.packets.append(Outgoing("stream", "peer", b"on"))


class Stream:
    """A stream link on which one peer says a word; ``mute`` fails to send that word."""

    name = "stream"
    peers: tuple[object, ...] = ()
    is_local = is_stream = True
    note = ""

    def __init__(self, mute: bytes) -> None:
        self.mute = mute
        self.sent: list[tuple[bytes, bool]] = []
        self.told = [PeerChange("peer", PeerState.UP)]
        self.read, self.write = os.pipe()
        os.write(self.write, b"!")

    def fileno(self) -> int:
        return self.read

    def receive(self, limit: int) -> list[tuple[object, bytes]]:
        os.read(self.read, 1)
        return [("peer", b"word")]

    def send(self, peer: object, data: bytes, *, first: bool = False) -> None:
        self.sent.append((data, first))
        if data == self.mute:
            raise ValueError

    def take_changes(self) -> list[PeerChange]:
        told, self.told = self.told, []
        return told

    def poll(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        os.close(self.read)
        os.close(self.write)


@pytest.mark.patches_core
@pytest.mark.parametrize("mute", [b"", b"zero"])
def test_after_the_last_words_of_a_failed_engine_nothing_of_it_is_sent(mute: bytes) -> None:
    link = Stream(mute)

    async def run() -> int:
        runner = Runner(Broken(), MemoryStore(), clients=[], vehicles=[link])
        return await asyncio.wait_for(runner.run(), 10)

    assert asyncio.run(run()) == 70
    words = [data for data, _ in link.sent]
    assert link.sent[words.index(b"zero") :] == [(b"zero", False), (b"hold", True)]
