"""Several rovers behind one endpoint: what is for all goes there once, or not at all."""

import pytest

from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason

RADIO, CLIENT = ("10.0.0.1", 1), ("10.0.0.2", 2)
GCS = Address(255, 190)
HOLD, GUIDED = 4, 15
ARMED = 128


class Rig:
    """Two rovers that answer nothing, at one radio."""

    def __init__(self, *, second: tuple[int, int]) -> None:
        self.engine = Engine(Settings(), now=0.0)
        self.packer = Packer()
        self.now = 0.0
        self.engine.handle(LinkChanged("v", LinkSide.VEHICLES, up=True), now=0.0)
        self.engine.handle(LinkChanged("c", LinkSide.CLIENTS, up=True), now=0.0)
        self.says(1, HOLD, ARMED)
        self.says(2, HOLD, second[1])
        self.asks_for_guided(1)
        if second[0] == GUIDED:
            self.asks_for_guided(2)
        self.says(1, GUIDED, ARMED)
        self.says(2, *second)
        self.engine.take_packets()

    def handle(self, link: str, peer: tuple[str, int], message: m.Message, source: Address) -> None:
        self.now += 0.1
        seq = round(self.now * 10) % 256
        data = self.packer.pack(message, source, seq=seq)
        self.engine.handle_deadline(now=self.now)
        self.engine.handle(Packets(link, [(peer, data)]), now=self.now)

    def says(self, system_id: int, mode: int, armed: int) -> None:
        heartbeat = m.Heartbeat(10, 3, 1 | armed, mode, 4, 3)
        self.handle("v", RADIO, heartbeat, Address(system_id, 1))

    def asks_for_guided(self, system_id: int) -> None:
        self.handle("c", CLIENT, m.SetMode(system_id, 1, GUIDED), GCS)

    def client_sends(self, message: m.Message) -> list[bytes]:
        """What of it goes to the radio."""
        self.handle("c", CLIENT, message, GCS)
        left = [o.data for o in self.engine.take_packets() if o.peer == RADIO]
        return [data for data in left if data[5] == GCS.system_id and data[7] == message.id]


def setpoint(system_id: int) -> m.Message:
    return m.SetPositionTargetLocalNed(
        0, system_id, 1, 8, 0x05C7, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0, 0
    )


@pytest.mark.parametrize(
    ("second", "count"),
    [((GUIDED, ARMED), 1), ((HOLD, ARMED), 0), ((HOLD, 0), 0), ((GUIDED, 0), 0)],
)
def test_what_moves_all_of_them_must_be_allowed_for_each(
    second: tuple[int, int], count: int
) -> None:
    assert len(Rig(second=second).client_sends(setpoint(0))) == count


def test_what_moves_one_passes_for_that_one() -> None:
    assert len(Rig(second=(HOLD, 0)).client_sends(setpoint(1))) == 1
    assert Rig(second=(HOLD, 0)).client_sends(setpoint(2)) == []


def test_a_heartbeat_goes_there_once() -> None:
    assert len(Rig(second=(HOLD, 0)).client_sends(m.Heartbeat(6, 8, 0, 0, 4, 3))) == 1


def test_what_is_withheld_changes_nothing_for_those_that_might_have_it() -> None:
    rig = Rig(second=(HOLD, 0))
    stop = m.CommandLong(2, 191, 54003, 0, 0, 0, 0, 0, 0, 0, 0)
    rig.handle("c", CLIENT, stop, GCS)
    rig.engine.take_events()
    assert rig.client_sends(setpoint(0)) == []
    assert rig.client_sends(m.RcChannelsOverride(0, 1, 1900, 0, 1900, 0, 0, 0, 0, 0)) == []
    refused = rig.engine.take_events()
    assert {(type(e), getattr(e, "vehicle", 0)) for e in refused} == {(SubmissionRefused, 2)}
    first = rig.engine.snapshot(now=rig.now).vehicles[0]
    assert first.paused is TaskReason.NONE
