"""Our decoder and encoder beside pymavlink's, for every message of the dialect."""

import math
from random import Random
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mav_tasks.mavlink import _dialect
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import DecodeCounts, Decoder, Encoder, Packer, target_of
from mav_tasks.mavlink.packet import Packet, split_datagram
from tests.unit.mavlink.samples import stock_message, stock_packet, values_of

KINDS = [pytest.param(kind, id=kind.msgname) for kind in m.ALL.values()]
V1_KINDS = [pytest.param(kind, id=kind.msgname) for kind in m.ALL.values() if kind.id < 256]
SOURCE = Address(12, 34)


def their_packet(message: m.Message, *, seq: int = 5, v1: bool = False) -> bytes:
    """What pymavlink's own code packs."""
    mav = _dialect.MAVLink(None, srcSystem=SOURCE.system_id, srcComponent=SOURCE.component_id)
    mav.seq = seq
    packed: bytes = message.pack(mav, force_mavlink1=v1)
    return packed


def their_message(raw: bytes) -> m.Message:
    """What pymavlink's own code decodes."""
    message: m.Message = _dialect.MAVLink(None).decode(bytearray(raw))
    return message


def fields(message: m.Message | None) -> tuple[str, str]:
    """Kind and all fields; as text, where NaN is equal to NaN and 0 is not -0."""
    assert message is not None
    return message.get_type(), repr([getattr(message, name) for name in message.fieldnames])


def only(raw: bytes) -> Packet:
    (packet,) = split_datagram(raw)
    return packet


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_of_any_kind_is_packed_as_pymavlink_packs_it(kind: Any) -> None:
    random = Random(kind.id)
    for seq in (0, 5, 255):
        message = kind(*values_of(kind, random))
        ours = Packer().pack(message, SOURCE, seq=seq)
        assert ours == their_packet(message, seq=seq)


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_of_any_kind_is_decoded_as_pymavlink_decodes_it(kind: Any) -> None:
    random = Random(kind.id)
    for _ in range(3):
        raw = their_packet(kind(*values_of(kind, random)))
        assert fields(Decoder().decode(only(raw))) == fields(their_message(raw))


@pytest.mark.parametrize("kind", V1_KINDS)
def test_mavlink_1_is_decoded_as_pymavlink_decodes_it(kind: Any) -> None:
    raw = their_packet(kind(*values_of(kind, Random(kind.id))), v1=True)
    assert fields(Decoder().decode(only(raw))) == fields(their_message(raw))


@pytest.mark.parametrize("kind", KINDS)
def test_a_payload_of_any_bytes_is_decoded_as_pymavlink_decodes_it(kind: Any) -> None:
    random = Random(kind.id)
    for length in {0, 1, kind.unpacker.size // 2, kind.unpacker.size, 255}:
        payload = random.randbytes(length)
        head = bytes([length, 0, 0, 9, 1, 2]) + kind.id.to_bytes(3, "little")
        crc = _dialect.x25crc(head + payload + bytes([kind.crc_extra])).crc
        raw = b"\xfd" + head + payload + crc.to_bytes(2, "little")
        assert fields(Decoder().decode(only(raw))) == fields(their_message(raw))


def test_a_message_of_the_stock_dialect_survives_the_way_through_ours() -> None:
    random = Random(4711)
    for number in range(500):
        raw = stock_packet(stock_message(random), seq=number % 256, source=SOURCE)
        message = Decoder().decode(only(raw))
        assert message is not None, f"seed 4711, packet {number}"
        again = Packer().pack(message, SOURCE, seq=number % 256)
        assert again == raw, f"seed 4711, packet {number}: {message}"


def test_nan_goes_through() -> None:
    raw = Encoder(SOURCE).encode(m.CommandLong(1, 1, 192, 0, *[math.nan] * 7))
    message = Decoder().decode(only(raw))
    assert isinstance(message, m.CommandLong)
    assert math.isnan(message.param7)


def test_an_encoder_numbers_its_packets_and_wraps() -> None:
    encoder = Encoder(SOURCE, first_seq=254)
    packets = [only(encoder.encode(m.Heartbeat(6, 8, 0, 0, 4, 3))) for _ in range(4)]
    assert [packet.seq for packet in packets] == [254, 255, 0, 1]
    assert {packet.source for packet in packets} == {SOURCE}


def test_the_decoder_counts_what_it_meets() -> None:
    good = their_packet(m.Heartbeat(6, 8, 0, 0, 4, 3))
    bad = good[:-1] + bytes([good[-1] ^ 1])
    unknown = good[:7] + b"\x33\x33\x33" + good[10:]
    decoder = Decoder()
    decoded = [decoder.decode(only(raw)) is not None for raw in (good, bad, unknown)]
    assert decoded == [True, False, False]
    assert decoder.counts == DecodeCounts(decoded=1, unknown=1, corrupt=1)


def test_no_single_bit_can_change_unseen() -> None:
    good = their_packet(m.Attitude(1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    decoder = Decoder()
    for index in range(3, len(good)):  # before: length and flags, where the packet would end
        for bit in range(8):
            raw = bytearray(good)
            raw[index] ^= 1 << bit
            assert decoder.decode(only(bytes(raw))) is None


@given(st.binary(max_size=600))
@example(b"\xfd\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00\x00")
@example(b"\xfe\x00\x00\x00\x00\x00\x00\x00")
def test_no_bytes_make_the_decoder_raise(data: bytes) -> None:
    decoder = Decoder()
    for packet in split_datagram(data):
        decoder.decode(packet)


@given(
    number=st.sampled_from(sorted(m.ALL)),
    payload=st.binary(max_size=255),
    v2=st.booleans(),
)
def test_no_payload_with_a_good_checksum_makes_it_raise(
    number: int, payload: bytes, v2: bool
) -> None:
    if v2:
        head = bytes([len(payload), 0, 0, 0, 1, 1]) + number.to_bytes(3, "little")
    else:
        head = bytes([len(payload), 0, 1, 1, number & 0xFF])
    kind = m.ALL.get(number if v2 else number & 0xFF)
    extra = bytes([0 if kind is None else kind.crc_extra])
    crc = _dialect.x25crc(head + payload + extra).crc
    decoder = Decoder()
    message = decoder.decode(
        only((b"\xfd" if v2 else b"\xfe") + head + payload + crc.to_bytes(2, "little"))
    )
    assert (message is None) == (kind is None)


@pytest.mark.parametrize(
    ("message", "target"),
    [
        (m.CommandLong(3, 4, 400, 0, 1, 0, 0, 0, 0, 0, 0), Address(3, 4)),
        (m.SetMode(3, 1, 4), Address(3, 0)),
        (m.Heartbeat(6, 8, 0, 0, 4, 3), Address(0, 0)),
    ],
    ids=["system and component", "system only", "neither"],
)
def test_the_target_of_a_message_is_0_where_it_names_none(
    message: m.Message, target: Address
) -> None:
    assert target_of(message) == target
