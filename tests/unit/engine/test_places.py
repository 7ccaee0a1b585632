"""Who comes back at another place is the same vehicle; who was there at the same time is not."""

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.settings import Settings

OLD, NEW = ("10.0.0.1", 1), ("10.0.0.1", 2)
HEARTBEAT = m.Heartbeat(10, 3, 1, 4, 4, 3)
LOST = Settings().watch.heartbeat_lost


class Rig:
    """A rover that is heard at one place or another, and a client that asks something of it."""

    def __init__(self) -> None:
        self.engine, self.packer = Engine(Settings(), now=0.0), Packer()
        for link, side in (
            ("v", LinkSide.VEHICLES),
            ("w", LinkSide.VEHICLES),
            ("c", LinkSide.CLIENTS),
        ):
            self.engine.handle(LinkChanged(link, side, up=True), now=0.0)

    def heard(self, at: float, *, old: bool) -> None:
        link, peer = ("v", OLD) if old else ("w", NEW)
        data = self.packer.pack(HEARTBEAT, Address(1, 1), seq=int(at * 4) % 256)
        self.engine.handle_deadline(now=at)
        self.engine.handle(Packets(link, [(peer, data)]), now=at)

    def reached_at(self, at: float) -> set[object]:
        """To where what is for the rover goes."""
        self.engine.handle_deadline(now=at - 0.4)  # what comes after a standstill may be old
        self.engine.handle_deadline(now=at)
        self.engine.take_packets()
        ping = m.SetMode(1, 0, 0)
        data = self.packer.pack(ping, Address(255, 190), seq=int(at) % 256)
        self.engine.handle(Packets("c", [(("10.0.0.3", 3), data)]), now=at)
        return {o.peer for o in self.engine.take_packets() if o.data[7] == ping.id}


@pytest.mark.parametrize("overlap", [0.0, 0.9])
def test_who_comes_back_elsewhere_at_once_is_followed_when_the_old_place_is_silent(
    overlap: float,
) -> None:
    rig = Rig()
    for at in (0.0, 1.0, 2.0):
        rig.heard(at, old=True)
    rig.heard(2.2, old=False)
    if overlap:
        rig.heard(2.2 + overlap, old=True)  # late on the net
    for step in range(1, 5):
        rig.heard(2.2 + step, old=False)
    assert rig.reached_at(6.5) == ({OLD} if overlap else {NEW})
    for step in range(5, 9):
        rig.heard(2.2 + step, old=False)
    assert rig.reached_at(10.5) == {NEW}


def test_however_many_have_called_a_vehicle_can_come_back_elsewhere() -> None:
    rig = Rig()
    rig.heard(0.0, old=True)
    data = rig.packer.pack(HEARTBEAT, Address(1, 1), seq=0)
    for port in range(1_000):
        rig.engine.handle(Packets("w", [(("10.9.9.9", port), data)]), now=0.5)
    rig.heard(2.0, old=True)
    rig.heard(2.0 + LOST + 1.0, old=False)
    assert rig.reached_at(7.0) == {NEW}
    assert "rover 1: is now at 10.0.0.1:2" in " ".join(map(str, rig.engine.take_events()))
