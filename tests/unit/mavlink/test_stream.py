"""Packets out of a stream, held against packets that stock pymavlink made."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from mav_tasks.mavlink.stream import MAX_STREAMS, PATIENCE, PeerStreams, StreamSplitter
from tests.unit.mavlink.samples import stock_message, stock_packet
from tests.unit.mavlink.test_packet import HEARTBEAT, V1, V2, signed, unknown

SEED = 20240608
#: what can begin nothing: neither magic byte is in it
QUIET_NOISE = st.binary(max_size=40).map(lambda data: data.translate(None, b"\xfd\xfe"))


def a_stream(random: Random) -> list[bytes]:
    """Some packets of every kind."""
    packets = [V1, V2, signed(HEARTBEAT, seq=9), unknown(seq=4)]
    for seq in range(30):
        is_v1 = random.random() < 0.3
        packets.append(stock_packet(stock_message(random, v1=is_v1), seq=seq, v1=is_v1))
    random.shuffle(packets)
    return packets


PACKETS = a_stream(Random(SEED))
STREAM = b"".join(PACKETS)


def split(*chunks: bytes, at: float = 0.0) -> list[bytes]:
    splitter = StreamSplitter()
    return [packet.raw for chunk in chunks for packet in splitter.feed(chunk, now=at)]


@given(st.lists(QUIET_NOISE, min_size=len(PACKETS), max_size=len(PACKETS)), st.integers(1, 300))
def test_noise_between_packets_costs_none(noises: list[bytes], size: int) -> None:
    data = b"".join(n + p for n, p in zip(noises, PACKETS, strict=True))
    chunks = [data[start : start + size] for start in range(0, len(data), size)]
    splitter = StreamSplitter()
    came = [packet.raw for chunk in chunks for packet in splitter.feed(chunk, now=0.0)]
    assert came == PACKETS
    assert splitter.noise == sum(map(len, noises))


def test_a_false_magic_byte_costs_no_packet() -> None:
    """It waits for what the false header promises, then all that had waited comes."""
    for false in (b"\xfd\xff\x00", b"\xfe\xff", b"\xfd\x09\x01", b"\xfe\x09", b"\xfd", b"\xfe"):
        assert split(false + STREAM) == PACKETS
        assert split(V2 + false, STREAM) == [V2, *PACKETS]


def test_flags_that_do_not_exist_are_not_waited_for() -> None:
    for flags in (0x02, 0x80, 0xFF):
        assert split(bytes((0xFD, 255, flags)) + V2) == [V2]


def test_on_a_quiet_link_a_false_magic_byte_is_given_up_in_time() -> None:
    splitter = StreamSplitter()
    assert splitter.feed(b"\xfe\xff", now=0.0) == []
    assert splitter.feed(V2, now=0.5) == []
    assert [p.raw for p in splitter.feed(V2, now=PATIENCE + 0.1)] == [V2, V2]


def test_a_packet_may_stop_halfway_for_as_long_as_a_bad_net_does_if_the_rest_then_comes() -> None:
    splitter = StreamSplitter()
    assert splitter.feed(V2[:9], now=0.0) == []
    assert [p.raw for p in splitter.feed(V2[9:], now=60.0)] == [V2]


def test_a_packet_inside_another_is_payload() -> None:
    """A log that is downloaded has packets in it: none of them was sent to us."""
    inner = stock_packet(
        common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0), seq=1
    )
    payload = [*inner, *(0,) * (128 - len(inner))]
    outer = stock_packet(common.MAVLink_tunnel_message(1, 1, 0, len(inner), payload), seq=2)
    assert split(*(bytes((byte,)) for byte in outer + V2)) == [outer, V2]


def test_a_packet_with_a_flipped_bit_is_none_and_the_next_is_whole() -> None:
    for packet, unsigned in ((V1, len(V1)), (V2, len(V2)), (signed(HEARTBEAT, seq=9), len(V2))):
        for index in range(1, unsigned):
            bad = bytearray(packet)
            bad[index] ^= 0x04
            came = split(bytes(bad) + STREAM)
            assert [raw for raw in came if raw in PACKETS][-len(PACKETS) :] == PACKETS, index
            assert packet not in came[: len(came) - len(PACKETS)]


def test_of_too_many_unfinished_packets_the_oldest_is_forgotten() -> None:
    streams = PeerStreams(is_stream=True)
    for peer in range(MAX_STREAMS + 1):
        streams.feed(peer, V2[:9], now=0.0)
    assert [len(streams.feed(peer, V2[9:], now=0.0)) for peer in (0, MAX_STREAMS)] == [0, 1]
