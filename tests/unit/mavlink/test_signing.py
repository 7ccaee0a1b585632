"""Signatures as pymavlink makes them, and when one is news."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.signing import (
    EPOCH,
    HIGHEST_TIMESTAMP,
    MOST_STREAMS,
    Key,
    Signer,
    Stream,
    StreamTimes,
    is_signed_with,
    signed,
    stream_of,
    timestamp_at,
    timestamp_of,
)
from tests.vectors.make_vectors import GOLDEN, LINK_IDS, SECRET, TIMESTAMPS

VECTORS: list[dict[str, Any]] = [
    vector for vector in json.loads(GOLDEN.read_text(encoding="utf-8")) if "signed" in vector
]
NUMBERED = list(enumerate(VECTORS))
WINDOW = 60 * 100_000
ONE, TWO = Stream(1, Address(255, 190)), Stream(2, Address(255, 190))
KEY = Key("anna", SECRET, "operator")

each = pytest.mark.parametrize(("number", "vector"), NUMBERED)


def only(raw: bytes) -> Packet:
    (packet,) = split_datagram(raw)
    return packet


@each
def test_pymavlinks_signature_is_verified_and_read(number: int, vector: dict[str, Any]) -> None:
    packet = only(bytes.fromhex(vector["signed"]))
    assert packet.is_signed
    assert is_signed_with(packet, SECRET)
    assert not is_signed_with(packet, bytes(32))
    assert stream_of(packet) == Stream(LINK_IDS[number % 3], Address(1 + number, 191))
    assert timestamp_of(packet) == TIMESTAMPS[number % 4]


@each
def test_our_signature_is_pymavlinks_bit_for_bit(number: int, vector: dict[str, Any]) -> None:
    """The packet is as long as it was and 13 bytes, so the CRC, which covers the flag, is new."""
    raw = bytes.fromhex(vector["packet"])
    made = signed(raw, SECRET, link_id=LINK_IDS[number % 3], timestamp=TIMESTAMPS[number % 4])
    assert made.hex() == vector["signed"]


@each
def test_a_mavlink_1_packet_has_no_signature(number: int, vector: dict[str, Any]) -> None:
    raw = bytes.fromhex(vector["v1"])
    assert signed(raw, SECRET, link_id=0, timestamp=number) == raw
    assert Signer(KEY, link_id=0).sign(raw, clock=1) == raw
    assert not only(raw).is_signed


@given(place=st.integers(0), bit=st.integers(0, 7))
def test_any_bit_that_is_changed_makes_it_nobodys(place: int, bit: int) -> None:
    raw = bytearray.fromhex(VECTORS[0]["signed"])
    raw[place % len(raw)] ^= 1 << bit
    for packet in split_datagram(bytes(raw)):
        assert not (packet.is_signed and is_signed_with(packet, SECRET))


def test_time_is_counted_in_ticks_of_10_us_since_2015() -> None:
    assert timestamp_at(EPOCH) == 0
    assert timestamp_at(EPOCH + 1.0) == 100_000
    assert timestamp_at(0.0) == 0
    assert timestamp_at(1e30) == HIGHEST_TIMESTAMP


# what is news


def test_in_a_stream_time_only_goes_on() -> None:
    times = StreamTimes()
    for timestamp, is_news in ((1000, True), (1000, False), (999, False), (1001, True)):
        assert times.is_news(ONE, timestamp, clock=1000, window=WINDOW) is is_news
        if is_news:
            times.note(ONE, timestamp)
    # of one that is known the clock is not asked: it may be far behind, and idle for long
    assert times.is_news(ONE, 1002, clock=10 * WINDOW, window=WINDOW)


def test_a_stream_begins_within_the_window() -> None:
    times = StreamTimes()
    clock = 5 * WINDOW
    assert times.is_news(ONE, clock - WINDOW, clock=clock, window=WINDOW)
    assert not times.is_news(ONE, clock - WINDOW - 1, clock=clock, window=WINDOW)
    assert times.is_news(ONE, clock + 10 * WINDOW, clock=clock, window=WINDOW)


def test_one_that_is_ahead_does_not_let_older_ones_begin() -> None:
    times = StreamTimes()
    times.note(ONE, 10 * WINDOW)
    assert not times.is_news(TWO, 8 * WINDOW, clock=8 * WINDOW, window=WINDOW)
    assert times.is_news(TWO, 9 * WINDOW, clock=8 * WINDOW, window=WINDOW)


def test_what_was_heard_in_a_forgotten_stream_is_no_news_again() -> None:
    times = StreamTimes()
    streams = [Stream(number % 256, Address(number // 256 + 1, 1)) for number in range(300)]
    heard = []
    for number, stream in enumerate(streams):
        timestamp = 1000 + number
        assert times.is_news(stream, timestamp, clock=1000, window=WINDOW)
        gone = times.note(stream, timestamp)
        assert (gone is not None) is (number >= MOST_STREAMS)
        heard.append((stream, timestamp))
    assert not [one for one in heard if times.is_news(one[0], one[1], clock=1000, window=WINDOW)]


@given(st.lists(st.tuples(st.integers(0, 200), st.integers(0, 3 * WINDOW)), max_size=300))
def test_nothing_is_ever_news_twice(packets: list[tuple[int, int]]) -> None:
    times, accepted = StreamTimes(), set()
    for number, timestamp in packets:
        stream = Stream(number, Address(1, 1))
        if times.is_news(stream, timestamp, clock=WINDOW, window=WINDOW):
            assert (stream, timestamp) not in accepted
            times.note(stream, timestamp)
            accepted.add((stream, timestamp))


# our own


def times_of(packets: list[bytes]) -> list[int]:
    return [timestamp_of(only(packet)) for packet in packets]


def test_each_of_our_signatures_is_later_than_the_one_before() -> None:
    raw = bytes.fromhex(VECTORS[0]["packet"])
    signer = Signer(KEY, link_id=3)
    clocks = (1000, 1000, 500, 1001, 5000)
    assert times_of([signer.sign(raw, clock=clock) for clock in clocks]) == [
        *(1000, 1001, 1002, 1003, 5000)
    ]
    signer.heard(9000)
    signer.heard(8000)
    assert times_of([signer.sign(raw, clock=6000)]) == [9001]


def test_a_time_that_cannot_be_later_is_the_latest() -> None:
    """Who holds a key must not be able to end a server by it."""
    raw = bytes.fromhex(VECTORS[0]["packet"])
    signer = Signer(KEY, link_id=3)
    signer.heard(HIGHEST_TIMESTAMP)
    assert times_of([signer.sign(raw, clock=1) for _ in range(2)]) == [HIGHEST_TIMESTAMP] * 2


def test_a_key_shows_nothing_of_its_secret() -> None:
    for shown in (repr(KEY), repr(Signer(KEY, link_id=1)), repr(Stream(1, Address(1, 1)))):
        assert SECRET.hex() not in shown
        assert repr(SECRET) not in shown
