"""Splitting and re-numbering raw packets, held against stock pymavlink's own packing."""

from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
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


class TestSplitting:
    @pytest.mark.parametrize("raw", [V1, V2], ids=["v1", "v2"])
    def test_a_packet_shows_its_header(self, raw: bytes) -> None:
        heartbeat = common.MAVLINK_MSG_ID_HEARTBEAT
        assert split_datagram(raw) == [Packet(raw, 7, Address(3, 1), heartbeat)]

    def test_system_and_component_are_those_of_its_source(self) -> None:
        (packet,) = split_datagram(V2)
        assert (packet.system_id, packet.component_id) == packet.source == (3, 1)

    def test_a_v1_packet_is_known_as_such(self) -> None:
        (v1,), (v2,) = split_datagram(V1), split_datagram(V2)
        assert [(p.is_v2, p.is_signed) for p in (v1, v2)] == [(False, False), (True, False)]

    def test_the_payload_lies_between_header_and_checksum(self) -> None:
        (v1,), (v2,) = split_datagram(V1), split_datagram(V2)
        assert (v1.payload, v2.payload) == (V1[6:-2], V2[10:-2])

    def test_a_message_id_has_three_bytes(self) -> None:
        (packet,) = split_datagram(unknown(seq=1))
        assert packet.message_id == 0xABCDEF

    def test_a_signature_belongs_to_its_packet(self) -> None:
        raw = signed(HEARTBEAT, seq=7)
        (first, second) = split_datagram(raw + V2)
        assert (first.raw, second.raw) == (raw, V2)
        assert first.is_signed
        assert first.payload == V2[10:-2]
        assert len(raw) == len(V2) + SIGNATURE_LENGTH

    def test_several_packets_come_out_in_order(self) -> None:
        assert [p.raw for p in split_datagram(V1 + V2 + unknown(seq=2) + V1)] == [
            V1,
            V2,
            unknown(seq=2),
            V1,
        ]

    def test_junk_before_between_and_after_is_skipped(self) -> None:
        assert [p.raw for p in split_datagram(JUNK + V2 + JUNK + V1 + JUNK)] == [V2, V1]

    @pytest.mark.parametrize("raw", [V1, V2, signed(HEARTBEAT, seq=7)], ids=["v1", "v2", "signed"])
    def test_a_packet_cut_at_any_length_is_no_packet(self, raw: bytes) -> None:
        assert [split_datagram(raw[:length]) for length in range(len(raw))] == [[]] * len(raw)

    def test_a_truncated_datagram_does_not_swallow_the_next(self) -> None:
        assert split_datagram(V2[:-1]) == []
        assert [p.raw for p in split_datagram(V2)] == [V2]

    @pytest.mark.parametrize("flags", [0x02, 0x03, 0x80, 0xFF])
    def test_a_packet_with_an_incompat_flag_that_nobody_knows_is_skipped(self, flags: int) -> None:
        strange = V2[:2] + bytes([flags]) + V2[3:]
        assert [p.raw for p in split_datagram(strange + V2)] == [V2]

    @given(st.binary(max_size=700))
    def test_packets_of_any_bytes_are_pieces_of_them_in_order(self, data: bytes) -> None:
        start = 0
        for packet in split_datagram(data):
            start = data.index(packet.raw, start) + len(packet.raw)

    @given(st.lists(st.sampled_from([V1, V2, b"\xfd\xfe", b"\xfe", b"\xfd" * 12]), max_size=8))
    def test_magic_bytes_in_junk_never_raise(self, parts: list[bytes]) -> None:
        split_datagram(b"".join(parts))


class TestRenumbering:
    def test_two_thousand_packets_are_as_stock_pymavlink_packs_them(self) -> None:
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

    @pytest.mark.parametrize("length", [0, 1, 2, 127, 254, 255])
    def test_an_unknown_message_of_any_length_keeps_a_good_checksum(self, length: int) -> None:
        payload = Random(length).randbytes(length)
        (packet,) = split_datagram(unknown(seq=250, payload=payload))
        assert with_seq(packet, 3) == unknown(seq=3, payload=payload)

    def test_a_corrupt_packet_stays_corrupt(self) -> None:
        random = Random(SEED)
        decoder = Decoder()
        for _ in range(500):
            raw = bytearray(stock_packet(HEARTBEAT, seq=random.randrange(256)))
            raw[random.randrange(10, len(raw))] ^= 1 << random.randrange(8)
            (packet,) = split_datagram(bytes(raw))
            (passed_on,) = split_datagram(with_seq(packet, random.randrange(256)))
            assert decoder.decode(passed_on) is None
        assert decoder.counts.corrupt == 500

    def test_the_same_number_leaves_a_packet_as_it_is(self) -> None:
        (packet,) = split_datagram(V2)
        assert with_seq(packet, 7) is packet.raw

    @pytest.mark.parametrize("seq", [7, 8])
    def test_a_signature_is_taken_off_and_its_flag_with_it(self, seq: int) -> None:
        (packet,) = split_datagram(signed(HEARTBEAT, seq=7))
        assert with_seq(packet, seq) == stock_packet(HEARTBEAT, seq=seq, source=(3, 1))


class TestAnotherPayload:
    @pytest.mark.parametrize("raw", [V1, V2, signed(HEARTBEAT, seq=7)], ids=["v1", "v2", "signed"])
    def test_decodes_as_the_message_with_the_other_field(self, raw: bytes) -> None:
        (packet,) = split_datagram(raw)
        other = with_payload(packet, 0, (0x04040000).to_bytes(4, "little"))
        assert not other.is_signed
        message = Decoder().decode(other)
        assert message is not None
        before = Decoder().decode(packet)
        assert before is not None
        assert message.to_dict() == {**before.to_dict(), "custom_mode": 0x04040000}

    def test_beyond_what_was_sent_is_left_out(self) -> None:
        (packet,) = split_datagram(V2)
        length = len(packet.payload)
        assert with_payload(packet, length - 1, b"\x07\x08\x09").payload[-1] == 7
        assert with_payload(packet, length, b"\x07") == packet._replace(
            raw=with_seq(packet, packet.seq)
        )

    def test_corrupt_stays_corrupt(self) -> None:
        broken = V2[:-1] + bytes([V2[-1] ^ 1])
        (packet,) = split_datagram(broken)
        assert Decoder().decode(with_payload(packet, 0, b"\x01\x02")) is None
