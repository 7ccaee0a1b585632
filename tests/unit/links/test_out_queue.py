"""What waits on a stream: whole packets, the newest first in rank, none for long."""

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.links.out_queue import CONGESTED_AFTER, MAX_BYTES, OutQueue

AGE = 0.2


def queue(*packets: bytes, at: float = 0.0) -> OutQueue:
    made = OutQueue(max_age=AGE)
    for packet in packets:
        made.put(packet, now=at)
    return made


def test_packets_leave_in_order() -> None:
    waiting = queue(b"one", b"two")
    waiting.wrote(len(waiting.next(now=0.0)))
    assert waiting.next(now=0.0) == b"two"
    waiting.wrote(3)
    assert (waiting.next(now=0.0), bool(waiting), waiting.dropped) == (b"", False, 0)


def test_what_has_begun_is_finished_however_old_it_is() -> None:
    waiting = queue(b"begun", b"old")
    waiting.next(now=0.0)
    waiting.wrote(2)
    waiting.put(b"new", now=60.0)
    assert waiting.next(now=60.0) == b"gun"
    waiting.wrote(3)
    assert waiting.next(now=60.0) == b"new"
    assert waiting.dropped == 1


def test_what_has_not_begun_gives_way_to_the_newest() -> None:
    waiting = OutQueue(max_age=AGE)
    for number in range(100):
        waiting.put(bytes([number]), now=number * 0.05)
    assert waiting.next(now=99 * 0.05) == bytes([96])
    assert waiting.dropped == 96


def test_what_is_to_go_first_waits_only_for_what_has_begun() -> None:
    waiting = queue(b"begun", b"old", b"older")
    waiting.wrote(2)
    for word in (b"hold", b"again"):
        waiting.put(word, now=0.1, first=True)
    out = []
    while piece := waiting.next(now=0.1):
        out.append(piece)
        waiting.wrote(len(piece))
    assert out == [b"gun", b"hold", b"again", b"old", b"older"]
    assert (waiting.size, bool(waiting), waiting.dropped) == (0, False, 0)


def test_what_was_to_go_first_grows_old_and_too_much_all_the_same() -> None:
    waiting = OutQueue(max_age=AGE)
    for _ in range(1_000):
        waiting.put(bytes(280), now=0.0, first=True)
    assert MAX_BYTES - 280 < waiting.size <= MAX_BYTES
    assert waiting.changed(now=0.15)
    assert waiting.next(now=AGE + 0.01) == b""
    assert (waiting.size, waiting.dropped) == (0, 1_000)


def test_what_waits_is_bounded() -> None:
    waiting = queue(*[bytes(280)] * 10_000)
    assert MAX_BYTES - 280 < waiting.size <= MAX_BYTES
    assert waiting.dropped == 10_000 - MAX_BYTES // 280


def test_it_is_congested_when_something_waits_for_long_until_nothing_waits() -> None:
    waiting = queue(b"one", b"two")
    assert not waiting.changed(now=CONGESTED_AFTER)
    assert waiting.changed(now=CONGESTED_AFTER + 0.01)
    assert waiting.is_congested
    waiting.wrote(3)
    assert not waiting.changed(now=0.12)
    waiting.put(b"three", now=0.13)
    waiting.wrote(3)
    assert not waiting.changed(now=0.13)
    waiting.wrote(5)
    assert waiting.changed(now=0.14)
    assert not waiting.is_congested


def test_a_packet_that_goes_out_byte_by_byte_is_congestion() -> None:
    waiting = queue(b"long packet")
    waiting.wrote(1)
    assert waiting.changed(now=1.0)


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 20), st.floats(0, 0.1)), max_size=60))
def test_whatever_is_dropped_only_whole_packets_come_out(
    steps: list[tuple[bool, int, float]],
) -> None:
    waiting, now, number, out = OutQueue(max_age=AGE), 0.0, 0, b""
    for is_put, size, passes in steps:
        now += passes
        if is_put:
            number += 1
            waiting.put(bytes([number]) * size + b"\0", now=now)
        elif piece := waiting.next(now=now)[:size]:
            out += piece
            waiting.wrote(len(piece))
    while piece := waiting.next(now=now):
        out += piece
        waiting.wrote(len(piece))
    packets = out.split(b"\0")[:-1]
    assert all(len(set(packet)) == 1 for packet in packets)
    firsts = [packet[0] for packet in packets]
    assert firsts == sorted(set(firsts))
    assert len(packets) + waiting.dropped == number


def test_it_says_what_it_is() -> None:
    assert repr(queue(b"x" * 3)) == "OutQueue(3 bytes wait, 0 packets dropped)"
