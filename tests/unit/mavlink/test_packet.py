"""Splitting and re-numbering raw packets, held against stock pymavlink's own packing."""

from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.packet import (
    SIGNATURE_LENGTH,
    Packet,
    split_datagram,
    with_payload,
    with_seq,
)
from tests.unit.mavlink.samples import stock_message, stock_packet

HEARTBEAT = common.MAVLink_heartbeat_message(10, 3, 81, 15, 4, 3)
V1 = stock_packet(HEARTBEAT, seq=7, source=(3, 1), v1=True)
V2 = stock_packet(HEARTBEAT, seq=7, source=(3, 1))
JUNK = b"\x00\x11\x22junk\xff"
SEED = 20240607


def signed(message: Any, *, seq: int) -> bytes:
    """A packet signed by stock pymavlink."""
    mav = common.MAVLink(None, srcSystem=3, srcComponent=1)
    mav.signing.secret_key = bytes(range(32))
    mav.signing.link_id = 4
    mav.signing.timestamp = 123456789
    mav.signing.sign_outgoing = True
    mav.seq = seq
    packed: bytes = message.pack(mav)
    return packed


def unknown(*, seq: int, message_id: int = 0xABCDEF, payload: bytes = b"\x01\x02\x03") -> bytes:
    """A MAVLink 2 packet of an id in no dialect, with a CRC_EXTRA that only its maker knows."""
    head = bytes([len(payload), 0, 0, seq, 9, 8]) + message_id.to_bytes(3, "little")
    crc: int = common.x25crc(head + payload + bytes([77])).crc
    return b"\xfd" + head + payload + crc.to_bytes(2, "little")


SIGNED = signed(HEARTBEAT, seq=7)


def test_a_packet_shows_its_header_payload_and_kind() -> None:
    heartbeat = common.MAVLINK_MSG_ID_HEARTBEAT
    for raw, payload, is_v2, is_signed in (
        (V1, V1[6:-2], False, False),
        (V2, V2[10:-2], True, False),
        (SIGNED, V2[10:-2], True, True),
    ):
        (packet,) = split_datagram(raw)
        assert packet == Packet(raw, 7, Address(3, 1), heartbeat)
        assert (packet.system_id, packet.component_id) == packet.source
        assert (packet.payload, packet.is_v2, packet.is_signed) == (payload, is_v2, is_signed)
    assert len(SIGNED) == len(V2) + SIGNATURE_LENGTH
    (packet,) = split_datagram(unknown(seq=1))
    assert packet.message_id == 0xABCDEF


def test_packets_come_out_in_order_and_junk_is_skipped() -> None:
    packets = [V1, SIGNED, V2, unknown(seq=2), V1]
    for between in (b"", JUNK):
        data = between + between.join(packets) + between
        assert [packet.raw for packet in split_datagram(data)] == packets
    for flags in (0x02, 0x03, 0x80, 0xFF):  # of incompatibility, that nobody knows
        strange = V2[:2] + bytes([flags]) + V2[3:]
        assert [packet.raw for packet in split_datagram(strange + V2)] == [V2]


def test_a_packet_cut_at_any_length_is_no_packet() -> None:
    for raw in (V1, V2, SIGNED):
        assert [split_datagram(raw[:length]) for length in range(len(raw))] == [[]] * len(raw)


def test_two_thousand_packets_are_renumbered_as_stock_pymavlink_packs_them() -> None:
    random = Random(SEED)
    for number in range(2000):
        v1 = number % 2 == 0
        message = stock_message(random, v1=v1)
        old, new = random.randrange(256), random.randrange(256)
        source = (random.randrange(1, 256), random.randrange(256))
        (packet,) = split_datagram(stock_packet(message, seq=old, source=source, v1=v1))
        assert with_seq(packet, new) == stock_packet(message, seq=new, source=source, v1=v1), (
            f"seed {SEED}, packet {number}: {message.get_type()}"
        )


def test_an_unknown_message_of_any_length_keeps_a_good_checksum() -> None:
    for length in (0, 1, 2, 127, 254, 255):
        payload = Random(length).randbytes(length)
        (packet,) = split_datagram(unknown(seq=250, payload=payload))
        assert with_seq(packet, 3) == unknown(seq=3, payload=payload)


def test_a_corrupt_packet_stays_corrupt() -> None:
    random = Random(SEED)
    for _ in range(500):
        raw = bytearray(stock_packet(HEARTBEAT, seq=random.randrange(256)))
        raw[random.randrange(10, len(raw))] ^= 1 << random.randrange(8)
        (packet,) = split_datagram(bytes(raw))
        (passed_on,) = split_datagram(with_seq(packet, random.randrange(256)))
        assert Decoder().decode(passed_on) is None
        assert Decoder().decode(with_payload(packet, 0, b"\x01\x02")) is None


def test_a_new_number_takes_a_signature_off_and_the_same_one_leaves_a_packet_alone() -> None:
    (packet,), (plain,) = split_datagram(SIGNED), split_datagram(V2)
    for seq in (7, 8):
        assert with_seq(packet, seq) == stock_packet(HEARTBEAT, seq=seq, source=(3, 1))
    assert with_seq(plain, 7) is plain.raw


def test_with_another_payload_it_is_the_message_with_the_other_field() -> None:
    for raw in (V1, V2, SIGNED):
        (packet,) = split_datagram(raw)
        other = with_payload(packet, 0, (0x04040000).to_bytes(4, "little"))
        assert not other.is_signed
        after, before = Decoder().decode(other), Decoder().decode(packet)
        assert after is not None
        assert before is not None
        assert after.to_dict() == {**before.to_dict(), "custom_mode": 0x04040000}
    (packet,) = split_datagram(V2)
    length = len(packet.payload)  # beyond what was sent is left out
    assert with_payload(packet, length - 1, b"\x07\x08\x09").payload[-1] == 7
    assert with_payload(packet, length, b"\x07").raw == with_seq(packet, packet.seq)
