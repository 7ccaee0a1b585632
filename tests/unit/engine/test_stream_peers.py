"""Where peers are: who comes and goes on a stream, and a rover that is heard at another place."""

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import (
    Committed,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    PeerChanged,
)
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.tasks.lifecycle import TaskState as S

OLD, NEW, CLIENT = ("10.0.0.1", 1), ("10.0.0.1", 2), ("10.0.0.9", 9)
ROVER = m.Heartbeat(10, 3, 1, 4, 4, 3)
ARMED = m.Heartbeat(10, 3, 0x81, 4, 4, 3)
ATTITUDE = m.Attitude(0, 0, 0, 0, 0, 0, 0)
GCS = m.Heartbeat(6, 8, 0, 0, 4, 3)
MOVE = 54000
MANY = 300  # more than are remembered of anything here


class Rig:
    """A server with a stream link on each side and a datagram link to vehicles."""

    def __init__(self, settings: Settings | None = None) -> None:
        self.engine, self.packer = Engine(settings or Settings(), now=0.0), Packer()
        self.now = 0.0
        for link, side, is_stream in (
            ("v", LinkSide.VEHICLES, True),
            ("u", LinkSide.VEHICLES, False),
            ("c", LinkSide.CLIENTS, True),
        ):
            self.engine.handle(LinkChanged(link, side, up=True, is_stream=is_stream), now=0.0)
        self.peer("v", OLD, up=True)

    def peer(self, link: str, peer: object, *, up: bool) -> None:
        self.engine.handle(PeerChanged(link, peer, up), now=self.now)

    def moves(self, new: object) -> None:
        """The rover's connection ends, and there is another one."""
        self.peer("v", OLD, up=False)
        self.peer("v", new, up=True)

    def says(self, link: str, peer: object, data: bytes, *, cut: int = 0) -> None:
        pieces = [data[:cut], data[cut:]] if cut else [data]
        for piece in pieces:
            self.engine.handle(Packets(link, [(peer, piece)]), now=self.now)

    def rover(
        self, peer: object, *, seq: int = 0, link: str = "v", message: m.Message = ROVER
    ) -> None:
        self.says(link, peer, self.packer.pack(message, Address(1, 1), seq=seq % 256))

    @property
    def is_armed(self) -> bool:
        (vehicle,) = self.engine.snapshot(now=self.now).vehicles
        return vehicle.armed

    def client(self) -> None:
        self.says("c", CLIENT, self.packer.pack(GCS, Address(255, 190), seq=0))

    def passes(self, seconds: float) -> list[Outgoing]:
        """Let time pass; gives what was sent."""
        self.engine.take_packets()
        end = self.now + seconds
        while (due := self.engine.next_deadline()) is not None and due <= end:
            self.now = max(self.now, due)
            self.engine.handle_deadline(now=self.now)
        self.now = end
        return self.engine.take_packets()


def ids(sent: list[Outgoing], link: str, peer: object) -> list[int]:
    """Message ids that went to somebody."""
    return [o.data[7] for o in sent if (o.link, o.peer) == (link, peer)]


@pytest.fixture
def rig() -> Rig:
    return Rig()


def test_who_comes_is_spoken_to_before_it_has_said_anything(rig: Rig) -> None:
    rig.peer("c", CLIENT, up=True)
    assert ids(rig.passes(1.5), "v", OLD)[:1] == [0]
    rig.engine.take_packets()
    rig.rover(OLD)
    assert ids(rig.engine.take_packets(), "c", CLIENT) == [0]


def test_what_two_senders_cut_is_not_mixed(rig: Rig) -> None:
    packets = [rig.packer.pack(ROVER, Address(number, 1), seq=0) for number in (1, 2)]
    for begin in range(0, 21, 5):
        for peer, packet in zip((OLD, NEW), packets, strict=True):
            rig.says("u", peer, packet[begin : begin + 5])
    assert len(rig.engine.snapshot(now=0.0).vehicles) == 2


@pytest.mark.parametrize("place", [OLD, NEW])
def test_what_is_on_another_connection_is_armed_only_if_it_says_so_itself(
    rig: Rig, place: object
) -> None:
    """Its numbers begin anew, a little below those of before: that is no heartbeat overtaken."""
    rig.rover(OLD, seq=50, message=ARMED)
    assert rig.is_armed
    rig.moves(place)
    rig.now = 0.2
    rig.rover(place, seq=0)
    assert not rig.is_armed


def test_heartbeats_are_not_overtaken_by_many_other_packets_between_them(rig: Rig) -> None:
    """A log is being downloaded, and a heartbeat was asked for."""
    rig.rover(OLD, seq=0, message=ARMED)
    for seq in range(1, 200):
        rig.now += 0.002
        rig.rover(OLD, seq=seq, message=ATTITUDE)
    rig.rover(OLD, seq=200)
    assert not rig.is_armed
    rig.rover(OLD, seq=190, message=ARMED)
    assert not rig.is_armed


@pytest.mark.parametrize(
    ("is_local", "arming", "begins"),
    [(True, "auto", True), (False, "auto", False), (False, "server", True)],
)
def test_what_is_at_another_place_is_armed_only_if_we_may_arm_there(
    is_local: bool, arming: str, begins: bool
) -> None:
    """A simulated rover ends, and one on a radio has its number."""
    rig = Rig(Settings(arming=arming))
    change = LinkChanged("radio", LinkSide.VEHICLES, up=True, is_local=is_local, is_stream=True)
    rig.engine.handle(change, now=0.0)
    rig.rover(OLD)
    rig.peer("v", OLD, up=False)
    rig.peer("radio", NEW, up=True)
    rig.rover(NEW, link="radio", seq=1)
    events = rig.engine.take_events()
    assert "is now at" in " ".join(map(str, events))
    move = m.CommandLong(1, 191, MOVE, 0, 1, 0, 0, 0, 0, 0, 0)
    rig.peer("c", CLIENT, up=True)
    rig.says("c", CLIENT, rig.packer.pack(move, Address(255, 190), seq=0))
    stored = len(events)
    for step in range(1, 60):
        rig.passes(0.05)
        for message in (
            m.Attitude(50 * step, 0, 0, 0, 0, 0, 0),
            m.LocalPositionNed(50 * step, 0, 0, 0, 0, 0, 0),
            *((ROVER,) if step % 20 == 0 else ()),
        ):
            rig.rover(NEW, link="radio", seq=3 * step, message=message)
        stored += len(rig.engine.take_events())
        rig.engine.handle(Committed(stored), now=rig.now)
    (task,) = rig.engine.snapshot(now=rig.now).tasks
    assert (task.state is S.STARTING, task.state is S.QUEUED) == (begins, not begins)


def test_a_vehicle_comes_back_however_often_its_connection_breaks(rig: Rig) -> None:
    for port in range(MANY):
        rig.peer("v", ("10.0.0.1", port), up=True)
        rig.rover(("10.0.0.1", port), seq=port % 256)
        rig.passes(0.01)
        rig.peer("v", ("10.0.0.1", port), up=False)
    rig.peer("v", NEW, up=True)
    rig.passes(0.1)
    rig.rover(NEW, seq=0)
    assert 0 in ids(rig.passes(2.0), "v", NEW)


def test_numbers_towards_a_line_that_comes_back_go_on(rig: Rig) -> None:
    rig.rover(OLD)
    before = [o.data[4] for o in rig.passes(2.5) if o.peer == OLD]
    rig.peer("v", OLD, up=False)
    rig.passes(0.1)
    rig.peer("v", OLD, up=True)
    rig.rover(OLD, seq=1)
    at_once = rig.engine.take_packets()
    after = [o.data[4] for o in at_once + rig.passes(2.5) if o.peer == OLD]
    numbers = before + after
    assert len(after) > 1
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def reached(rig: Rig) -> set[object]:
    """Return to where what a client has for the rover goes."""
    rig.passes(0.4)
    rig.says("c", CLIENT, rig.packer.pack(m.SetMode(1, 0, 0), Address(255, 190), seq=1))
    return {o.peer for o in rig.engine.take_packets() if o.data[7] == m.SetMode.id}


@pytest.mark.parametrize("overlap", [False, True])
def test_who_is_heard_elsewhere_is_followed_once_the_old_place_is_silent(
    rig: Rig, *, overlap: bool
) -> None:
    rig.peer("c", CLIENT, up=True)
    for at in range(3):
        rig.rover(OLD, seq=at, link="u")
        rig.passes(0.7 if at == 2 else 1.0)
    rig.rover(NEW, seq=3, link="u")
    rig.passes(0.9)
    if overlap:
        rig.rover(OLD, seq=4, link="u")  # late on the net
    rig.passes(0.1)
    for seq in range(5, 8):
        rig.passes(1.0)
        rig.rover(NEW, seq=seq, link="u")
    assert reached(rig) == ({OLD} if overlap else {NEW})
    for seq in range(8, 14):
        rig.passes(0.9)
        rig.rover(NEW, seq=seq, link="u")
    assert reached(rig) == {NEW}
