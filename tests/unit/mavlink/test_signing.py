"""Signatures as pymavlink makes them, and when one is news."""

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.signing import (
    EPOCH,
    HIGHEST_TIMESTAMP,
    MOST_STREAMS,
    UNITS,
    Key,
    Signer,
    Stream,
    StreamTimes,
    Window,
    is_signed_with,
    signed,
    stream_of,
    timestamp_at,
    timestamp_of,
)
from tests.unit.mavlink.samples import stock_message, stock_packet

SECRET = bytes(range(7, 39))
WINDOW = 60 * 100_000
ONE = Stream(1, Address(255, 190))
KEY = Key("anna", SECRET, "operator")


def only(raw: bytes) -> Packet:
    (packet,) = split_datagram(raw)
    return packet


def test_pymavlinks_signature_is_read_and_ours_is_the_same_bit_for_bit() -> None:
    """The packet is as long as it was and 13 bytes, so the CRC, which covers the flag, is new."""
    for number, timestamp in enumerate((1, 37_000_000_000_000, (1 << 48) - 2, 0xFF00)):
        message, link = stock_message(Random(number), v1=True), (0, 1, 255, 7)[number]
        signature = SECRET, link, timestamp
        theirs = stock_packet(message, seq=9, source=ONE.source, signature=signature)
        packet = only(theirs)
        assert packet.is_signed
        assert is_signed_with(packet, SECRET)
        assert not is_signed_with(packet, bytes(32))
        assert (stream_of(packet), timestamp_of(packet)) == (Stream(link, ONE.source), timestamp)
        raw = stock_packet(message, seq=9, source=ONE.source)
        assert signed(raw, SECRET, link_id=link, timestamp=timestamp) == theirs
        v1 = stock_packet(message, seq=9, source=ONE.source, v1=True)  # has no signature
        assert signed(v1, SECRET, link_id=0, timestamp=1) == v1
        assert Signer(KEY, link_id=0).sign(v1, clock=1) == v1
        assert not only(v1).is_signed


@given(place=st.integers(0), bit=st.integers(0, 7))
def test_any_bit_that_is_changed_makes_it_nobodys(place: int, bit: int) -> None:
    raw = bytearray(stock_packet(stock_message(Random(0)), seq=9, signature=(SECRET, 1, 2)))
    raw[place % len(raw)] ^= 1 << bit
    for packet in split_datagram(bytes(raw)):
        assert not (packet.is_signed and is_signed_with(packet, SECRET))


def test_time_is_counted_in_ticks_of_10_us_since_2015() -> None:
    assert timestamp_at(EPOCH) == 0
    assert timestamp_at(EPOCH + 1.0) == 100_000
    assert timestamp_at(0.0) == 0
    assert timestamp_at(1e30) == HIGHEST_TIMESTAMP


# what is news


def window(clock: int, *, now: float = 0.0, latest: int | None = None) -> Window:
    """A minute on both sides of the clock."""
    newest = clock + WINDOW
    return Window(clock - WINDOW, newest, latest or newest, WINDOW, now)


def test_a_clock_that_counts_packets_is_believed_while_it_is_not_silent() -> None:
    times, clock = StreamTimes(), 10 * WINDOW
    for number in range(10):
        seen = window(clock + number * 50 * int(UNITS), now=number * 50.0)
        assert times.is_news(ONE, clock + number, seen)
        times.note(ONE, clock + number, seen)
    late = window(clock + 511 * int(UNITS), now=511.0)
    assert not times.is_news(ONE, clock + 10, late)


def test_a_time_that_cannot_be_right_keeps_nobody_out() -> None:
    """Not of its own stream, nor of others, though there is no room for more."""
    times, clock = StreamTimes(), 10 * WINDOW
    for number in range(MOST_STREAMS):
        times.restore(Stream(number, Address(255, 190)), 1000 * WINDOW + number)
    for stream in (Stream(3, Address(255, 190)), Stream(200, Address(255, 190)), ONE):
        for timestamp in (clock, clock + 1):
            assert times.is_news(stream, timestamp, window(clock))
            times.note(stream, timestamp, window(clock))
            assert not times.is_news(stream, timestamp, window(clock))


def test_what_was_heard_in_a_forgotten_stream_is_no_news_again() -> None:
    times = StreamTimes()
    streams = [Stream(number % 256, Address(number // 256 + 1, 1)) for number in range(300)]
    heard = []
    for number, stream in enumerate(streams):
        timestamp = 1000 + number
        assert times.is_news(stream, timestamp, window(1000))
        gone = times.note(stream, timestamp, window(1000))
        assert (gone is not None) is (number >= MOST_STREAMS)
        heard.append((stream, timestamp))
    assert not [one for one in heard if times.is_news(*one, window(1000))]


@given(st.lists(st.tuples(st.integers(0, 200), st.integers(0, 3 * WINDOW)), max_size=300))
def test_nothing_is_ever_news_twice(packets: list[tuple[int, int]]) -> None:
    times, accepted = StreamTimes(), set()
    for number, timestamp in packets:
        stream = Stream(number, Address(1, 1))
        if times.is_news(stream, timestamp, window(WINDOW)):
            assert (stream, timestamp) not in accepted
            times.note(stream, timestamp, window(WINDOW))
            accepted.add((stream, timestamp))


# our own


def times_of(packets: list[bytes]) -> list[int]:
    return [timestamp_of(only(packet)) for packet in packets]


def test_each_of_our_signatures_is_later_than_the_one_before() -> None:
    raw = stock_packet(stock_message(Random(0)), seq=9)
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
    raw = stock_packet(stock_message(Random(0)), seq=9)
    signer = Signer(KEY, link_id=3)
    signer.heard(HIGHEST_TIMESTAMP)
    assert times_of([signer.sign(raw, clock=1) for _ in range(2)]) == [HIGHEST_TIMESTAMP] * 2


def test_a_key_shows_nothing_of_its_secret() -> None:
    for shown in (repr(KEY), repr(Signer(KEY, link_id=1)), repr(Stream(1, Address(1, 1)))):
        assert SECRET.hex() not in shown
        assert repr(SECRET) not in shown
