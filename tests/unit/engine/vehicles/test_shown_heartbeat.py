import pytest

from mav_tasks.engine.vehicles.shown_heartbeat import ShownHeartbeat
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.packet import Packet, split_datagram

ARMED, STANDBY, ACTIVE, CRITICAL = 128, 3, 4, 5


def packet(message: m.Message, *, component: int = 1) -> Packet:
    (found,) = split_datagram(Packer().pack(message, Address(1, component), seq=7))
    return found


def beat(base_mode: int, status: int, mode: int = 4) -> m.Heartbeat:
    return m.Heartbeat(10, 3, base_mode, mode, status, 3)


def read(found: Packet) -> tuple[int, int, int]:
    """(base_mode, custom_mode, system_status) of a packet whose CRC is right."""
    message = Decoder().decode(found)
    assert isinstance(message, m.Heartbeat)
    return message.base_mode, message.custom_mode, message.system_status


@pytest.mark.parametrize(
    ("base_mode", "status", "shown"),
    [
        (ARMED | 1, STANDBY, ACTIVE),
        (ARMED | 1, ACTIVE, ACTIVE),
        (ARMED | 1, CRITICAL, CRITICAL),
        (1, STANDBY, STANDBY),
    ],
)
def test_what_is_armed_is_shown_active(base_mode: int, status: int, shown: int) -> None:
    heartbeats = ShownHeartbeat()
    own = beat(base_mode, status)
    assert read(heartbeats.applied(packet(own), is_stopped=False, now=0.0)) == (base_mode, 4, shown)
    assert heartbeats.in_message(own).system_status == shown


def test_a_mode_is_shown_for_a_while() -> None:
    heartbeats = ShownHeartbeat()
    heartbeats.show(10, until=1.0)
    own = packet(beat(ARMED, STANDBY))
    assert read(heartbeats.applied(own, is_stopped=False, now=0.9)) == (ARMED, 10, ACTIVE)
    assert read(heartbeats.applied(own, is_stopped=False, now=1.0)) == (ARMED, 4, ACTIVE)
    heartbeats.show(10, until=3.0)
    heartbeats.forget()
    assert read(heartbeats.applied(own, is_stopped=False, now=2.0)) == (ARMED, 4, ACTIVE)


def test_everything_else_is_as_it_came() -> None:
    heartbeats = ShownHeartbeat()
    cut_short = packet(m.Heartbeat(10, 3, ARMED, 4, 0, 0))  # zeros at the end are not sent
    assert heartbeats.applied(cut_short, is_stopped=False, now=0.0) == cut_short
    heartbeats.show(10, until=1.0)
    others = (beat(ARMED, STANDBY), 191), (m.SystemTime(1, 1), 1)
    for message, component in others:
        other = packet(message, component=component)
        assert heartbeats.applied(other, is_stopped=False, now=0.0) == other
