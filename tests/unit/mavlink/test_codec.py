"""Our decoder and encoder beside pymavlink's, for every message of the dialect."""

from collections.abc import Iterator
from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.mavlink import _dialect
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import DecodeCounts, Decoder, Encoder, Packer, target_of
from mav_tasks.mavlink.packet import Packet, split_datagram
from tests.unit.mavlink.samples import message_of, raw_packet, stock_packet

SOURCE = Address(12, 34)


def their_packet(message: m.Message, *, seq: int = 5, v1: bool = False) -> bytes:
    """What pymavlink's own code packs."""
    mav = _dialect.MAVLink(None, srcSystem=SOURCE.system_id, srcComponent=SOURCE.component_id)
    mav.seq = seq
    packed: bytes = message.pack(mav, force_mavlink1=v1)
    return packed


def fields(message: m.Message | None) -> tuple[str, str]:
    """Kind and all fields; as text, where NaN is equal to NaN and 0 is not -0."""
    assert message is not None
    return message.get_type(), repr([getattr(message, name) for name in message.fieldnames])


def only(raw: bytes) -> Packet:
    (packet,) = split_datagram(raw)
    return packet


def test_messages_of_all_kinds_are_packed_as_pymavlink_packs_them() -> None:
    for number, kind in m.ALL.items():
        random = Random(number)
        for seq in (0, 5, 255):
            message = message_of(kind, random, _dialect)
            ours = Packer().pack(message, SOURCE, seq=seq)
            assert ours == their_packet(message, seq=seq), message


def packets_of(kind: Any) -> Iterator[bytes]:
    """Packets of fields, and of payloads of any bytes that are too short or too long."""
    random = Random(kind.id)
    for v1 in (False, False, False, *(True,) * (kind.id < 256)):
        yield their_packet(message_of(kind, random, _dialect), v1=v1)
    for length in (0, 1, kind.unpacker.size // 2, kind.unpacker.size, 255):
        yield raw_packet(kind, random.randbytes(length))


def test_packets_of_all_kinds_are_decoded_as_pymavlink_decodes_them() -> None:
    for kind in m.ALL.values():
        for raw in packets_of(kind):
            theirs = _dialect.MAVLink(None).decode(bytearray(raw))
            assert fields(Decoder().decode(only(raw))) == fields(theirs), raw.hex()


def test_the_stock_dialect_s_packets_of_either_version_are_understood_and_made() -> None:
    """It has some of the messages without their newest extensions."""
    for number in m.ALL.keys() & common.mavlink_map.keys():
        theirs = message_of(common.mavlink_map[number], Random(number))
        for v1 in (False, True)[: 1 + (number < 256)]:
            raw = stock_packet(theirs, seq=5, source=SOURCE, v1=v1)
            theirs = common.MAVLink(None).decode(bytearray(raw))
            ours = Decoder().decode(only(raw))
            assert ours is not None
            for name in theirs.fieldnames:
                assert repr(getattr(ours, name)) == repr(getattr(theirs, name)), (theirs, name)
            assert v1 or Packer().pack(ours, SOURCE, seq=5) == raw, theirs


def test_an_encoder_numbers_its_packets_and_wraps() -> None:
    encoder = Encoder(SOURCE, first_seq=254)
    packets = [only(encoder.encode(m.Heartbeat(6, 8, 0, 0, 4, 3))) for _ in range(4)]
    assert [(packet.seq, packet.source) for packet in packets] == [
        (seq, SOURCE) for seq in (254, 255, 0, 1)
    ]


def test_the_decoder_counts_what_it_meets_and_sees_each_flipped_bit() -> None:
    good = their_packet(m.Attitude(1, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6))
    unknown = good[:7] + b"\x33\x33\x33" + good[10:]
    decoder = Decoder()
    assert decoder.decode(only(good))
    assert decoder.decode(only(unknown)) is None
    assert decoder.counts == DecodeCounts(decoded=1, unknown=1, corrupt=0)
    for bit in range(3 * 8, len(good) * 8):  # before: length and flags, where it would end
        raw = bytearray(good)
        raw[bit // 8] ^= 1 << bit % 8
        assert decoder.decode(only(bytes(raw))) is None
    assert decoder.counts.decoded == 1


def test_the_target_of_a_message_is_0_where_it_names_none() -> None:
    assert target_of(m.CommandLong(3, 4, 400, 0, 1, 0, 0, 0, 0, 0, 0)) == Address(3, 4)
    assert target_of(m.SetMode(3, 1, 4)) == Address(3, 0)
    assert target_of(m.Heartbeat(6, 8, 0, 0, 4, 3)) == Address(0, 0)


def test_zero_means_everybody() -> None:
    targets = {(1, 1), (1, 0), (0, 1), (0, 0), (1, 191), (2, 1), (2, 0), (0, 191)}
    reached = {target for target in targets if Address(*target).reaches(Address(1, 1))}
    assert reached == {(1, 1), (1, 0), (0, 1), (0, 0)}
    assert str(Address(255, 190)) == "255/190"
