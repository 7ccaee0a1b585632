"""What clients make the engine remember: little of strangers, and nothing that grows for ever."""

import gc
import tracemalloc
from collections.abc import Callable, Iterator

import pytest

from mav_tasks.config.settings import Clients, Roles, Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import Committed, LinkChanged, LinkSide, Packets, Peer
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram

CONTINUE, SET_MODE, MOVE, MODIFY = 193, 176, 54000, 54012
START_DELAY, DEADLINE = 2, 3
OPERATOR = Address(255, 190)
KB = 1000


class Rig:
    """An engine in virtual time, with a rover that is heard, and nothing that keeps its events."""

    def __init__(self, settings: Settings) -> None:
        self.now = 0.0
        self.engine = Engine(settings, now=0.0)
        self._rover = Encoder(Address(1, 1))
        self._events = 0
        self.acks: list[tuple[Peer, m.CommandAck]] = []
        self.told: set[Peer] = set()  # to whom something was sent
        for link, side in (("v", LinkSide.VEHICLES), ("c", LinkSide.CLIENTS)):
            self.engine.handle(LinkChanged(link, side, up=True), now=0.0)
        self.passes(1.0)

    def passes(self, seconds: float) -> None:
        """Let time pass, in which the rover sends its heartbeat."""
        end = self.now + seconds
        while self.now < end:
            self.now = min(end, self.now + 0.5)
            beat = m.Heartbeat(10, 3, 1, 4, 3, 3)
            self.engine.handle(Packets("v", [("rover", self._rover.encode(beat))]), now=self.now)
            self.engine.handle_deadline(now=self.now)
            self._take()

    def says(self, peer: Peer, encoder: Encoder, message: m.Message) -> None:
        """Let a client send a message."""
        self.engine.handle(Packets("c", [(peer, encoder.encode(message))]), now=self.now)
        self._take()

    def _take(self) -> None:
        decoder = Decoder()
        while events := self.engine.take_events():
            self._events += len(events)
            self.engine.handle(Committed(self._events), now=self.now)
        for outgoing in self.engine.take_packets():
            self.told.add(outgoing.peer)
            for packet in split_datagram(outgoing.data):
                if packet.message_id == m.CommandAck.id:
                    ack = decoder.decode(packet)
                    assert isinstance(ack, m.CommandAck)
                    self.acks.append((outgoing.peer, ack))


@pytest.fixture
def growth() -> Iterator[Callable[[], int]]:
    """Yield a function that returns by how many bytes the memory in use has grown."""
    tracemalloc.start()
    gc.collect()
    before = [0]

    def grown() -> int:
        gc.collect()
        now = tracemalloc.get_traced_memory()[0]
        since, before[0] = now - before[0], now
        return since

    grown()
    yield grown
    tracemalloc.stop()


def command(number: int, *params: float, target: int = 191) -> m.CommandLong:
    """Return a COMMAND_LONG to rover 1; missing parameters are 0."""
    return m.CommandLong(1, target, number, 0, *params, *(0.0,) * (7 - len(params)))


@pytest.mark.parametrize("number", [CONTINUE, SET_MODE])
def test_words_that_a_stranger_may_not_say_are_not_remembered(
    growth: Callable[[], int], number: int
) -> None:
    endpoints, addresses, words = 4, 16, 12
    rig = Rig(Settings(roles=Roles(unsigned="observer")))
    encoders = [Encoder(Address(1 + each, 1)) for each in range(1, 1 + addresses)]
    for port in range(endpoints):
        rig.says(("h", port), encoders[0], m.Heartbeat(6, 8, 0, 0, 4, 3))
    growth()
    for word in range(words):
        rig.passes(0.5)
        for port in range(endpoints):
            for encoder in encoders:
                message = command(number, 1, 15, 0, 0, word, target=1)
                rig.says(("h", port), encoder, message)
        rig.acks.clear()
    assert growth() < endpoints * 40 * KB


def test_however_many_strangers_come_an_operator_keeps_its_place() -> None:
    settings = Settings(
        clients=Clients(max_clients=8),
        roles=Roles(unsigned="observer", addresses={str(OPERATOR): "operator"}),
    )
    rig = Rig(settings)
    beat = m.Heartbeat(6, 8, 0, 0, 4, 3)
    for _ in range(2):
        rig.says("operator", Encoder(OPERATOR), beat)
        rig.passes(1.0)
    for port in range(200):
        rig.says(("stranger", port), Encoder(Address(10, 1)), beat)
        rig.passes(0.1)
    rig.told.clear()
    rig.passes(2.0)
    assert "operator" in rig.told


@pytest.mark.parametrize("what", [START_DELAY, DEADLINE])
def test_times_that_are_moved_for_ever_take_no_memory(growth: Callable[[], int], what: int) -> None:
    rig = Rig(Settings())
    client = Encoder(OPERATOR)
    rig.says("client", client, command(MOVE, 1.0))
    ((_, ack),) = rig.acks
    assert ack.result == 0, ack
    task = ack.result_param2
    for change in range(1_000):
        if change == 700:  # the lists that have an upper limit are full
            growth()
        message = command(MODIFY, task, what, 5000.0 + change % 1000 + change / 3000)
        rig.passes(0.02)
        rig.acks.clear()
        rig.says("client", client, message)
        assert [each.result for _, each in rig.acks] == [0]
    assert growth() < 40 * KB
