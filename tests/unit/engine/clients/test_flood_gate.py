"""What passes the gate when it lets nothing more in: STOP, in whatever form, and nothing else."""

from collections.abc import Hashable, Sequence

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.clients.flood_gate import MOST_STOPS, STRANGERS, FloodGate, FloodGates
from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.settings import Clients
from tests.kit.client import MOVE, STOP, Message, command_long, heartbeat


def packed(message: Message, *, v1: bool = False) -> bytes:
    raw: bytes = message.pack(common.MAVLink(None, 255, 190), force_mavlink1=v1)
    return raw


def command_int(command: int) -> Message:
    return common.MAVLink_command_int_message(1, 191, 0, command, 0, 0, 0, 0, 0, 0, 0, 0, 0)


BEAT = packed(heartbeat())
STOPS = {
    "v2": packed(command_long(STOP)),
    "v1": packed(command_long(STOP), v1=True),
    "int": packed(command_int(STOP)),
    "int, v1": packed(command_int(STOP), v1=True),
    "after others": BEAT + BEAT + packed(command_long(STOP)),
    "before others": packed(command_long(STOP)) + BEAT,
    "after its number": STOP.to_bytes(2, "little") + packed(command_long(STOP)),
}
NUMBER = STOP.to_bytes(2, "little")
OTHERS = {
    "beat": BEAT,
    "move": packed(command_long(MOVE)),
    "number": NUMBER,
    "number at the end": BEAT + NUMBER,
    "many numbers": NUMBER * 100,
    "text": packed(common.MAVLink_statustext_message(6, NUMBER * 25)),
    "ack": packed(common.MAVLink_command_ack_message(STOP, 0)),
    "item": packed(common.MAVLink_mission_item_int_message(1, 1, 0, 6, STOP, *[0] * 9)),
    "parameter": packed(command_long(MOVE, 1.0)) + NUMBER,
}


@pytest.fixture
def full() -> FloodGate:
    """Return a gate of which strangers have used up all."""
    gate = FloodGate(rate=10.0, is_known=lambda _: False)
    passed(gate, [(number, BEAT) for number in range(int(STRANGERS))], now=0.0)
    return gate


def passed(
    gate: FloodGate, datagrams: list[tuple[Hashable, bytes]], *, now: float
) -> Sequence[tuple[Hashable, bytes]]:
    """Return what a gate lets in."""
    return gate.let_in(Packets("link", datagrams), now=now).datagrams


@pytest.mark.parametrize("form", STOPS)
def test_a_stop_is_let_in(full: FloodGate, form: str) -> None:
    ((who, alone),) = passed(full, [("somebody", STOPS[form])], now=0.0)
    (packet,) = split_datagram(alone)
    assert (who, packet.raw) == ("somebody", alone)
    assert packet.message_id in (75, 76)


def test_a_signed_stop_is_let_in_whole(full: FloodGate) -> None:
    mav = common.MAVLink(None, 255, 190)
    mav.signing.secret_key, mav.signing.sign_outgoing = b"s" * 32, True
    stop = command_long(STOP).pack(mav)
    assert passed(full, [("somebody", BEAT + stop + BEAT)], now=0.0) == [("somebody", stop)]


def test_each_of_several_stops_in_one_datagram_is_let_in_up_to_a_number(full: FloodGate) -> None:
    stops = [packed(command_long(STOP, target=(number, 191))) for number in (1, 2, 3)]
    assert passed(full, [("somebody", BEAT.join(stops))], now=0.0) == [
        ("somebody", b"".join(stops))
    ]
    ((_, many),) = passed(full, [("somebody", stops[0] * 100)], now=0.0)
    assert many == stops[0] * MOST_STOPS


def test_a_datagram_of_many_packets_counts_as_many(full: FloodGate) -> None:
    many = BEAT * 2000
    assert passed(full, [("somebody", many)], now=1.0) == []
    assert passed(full, [("somebody", BEAT * 10)] * 200, now=1.0) == [("somebody", BEAT * 10)] * 125


@pytest.mark.parametrize("what", OTHERS)
def test_nothing_else_is_though_it_has_the_number_of_stop_in_it(full: FloodGate, what: str) -> None:
    assert passed(full, [("somebody", OTHERS[what])], now=0.0) == []


def test_what_is_let_in_keeps_when_it_arrived() -> None:
    gates = FloodGates(is_client=lambda *_: True, settings=Clients(packet_rate=20.0))
    gates.change_link(LinkChanged("link", LinkSide.CLIENTS, up=True))
    stop = STOPS["v2"]
    datagrams = [("somebody", b"x"), ("somebody", bytes(2000)), ("somebody", stop)]
    let_in = gates.let_in(Packets("link", datagrams, [3.0, 2.0, 1.0]), now=0.0)
    assert let_in == Packets("link", [datagrams[0], datagrams[2]], [3.0, 1.0])
