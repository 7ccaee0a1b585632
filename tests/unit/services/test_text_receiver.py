"""STATUSTEXT in chunks becomes texts again, as whole as they came."""

from math import inf

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Statustext
from mav_tasks.services.statustext import chunks
from mav_tasks.services.text_receiver import MOST_CHUNKS, MOST_OPEN, PATIENCE, TextReceiver

ROVER = Address(1, 1)
OTHER = Address(2, 1)


def words(receiver: TextReceiver, *messages: Statustext, sender: Address = ROVER) -> list[str]:
    return [text.words for each in messages for text in receiver.receive(sender, each, now=0.0)]


def long(length: int, *, text_id: int = 7, letter: str = "a") -> list[Statustext]:
    return list(chunks(MavSeverity.ERROR, letter * length, text_id=text_id))


def test_a_short_text_is_whole_at_once() -> None:
    (text,) = TextReceiver().receive(ROVER, Statustext(4, b"low battery\0rest"), now=0.0)
    assert text == (ROVER, MavSeverity.WARNING, "low battery")


def test_a_long_text_is_joined_whatever_its_length_and_the_order_of_its_chunks() -> None:
    for length in (51, 99, 100, 101, 150, 737):
        receiver = TextReceiver()
        assert words(receiver, *long(length)) == ["a" * length]
        assert words(receiver, *reversed(long(length))) == ["a" * length]
        assert receiver.next_deadline() == inf


def test_a_chunk_that_comes_twice_counts_once() -> None:
    first, second = long(80)
    assert words(TextReceiver(), first, first, second) == ["a" * 80]


def test_senders_and_ids_are_not_mixed() -> None:
    receiver = TextReceiver()
    a, b = long(80), long(80, text_id=8, letter="b")
    assert words(receiver, a[0], b[0]) == []
    assert words(receiver, long(60, letter="c")[0], sender=OTHER) == []
    assert words(receiver, b[1], a[1]) == ["b" * 80, "a" * 80]
    assert words(receiver, long(60, letter="c")[1], sender=OTHER) == ["c" * 60]


def test_a_chunk_that_does_not_come_is_not_waited_for() -> None:
    receiver = TextReceiver()
    first, _, last = long(120)
    assert words(receiver, first, last) == []
    assert receiver.next_deadline() == PATIENCE
    assert list(receiver.handle_deadline(now=PATIENCE - 0.1)) == []
    (text,) = receiver.handle_deadline(now=PATIENCE)
    assert text == (ROVER, MavSeverity.ERROR, "a" * 50 + "[…]" + "a" * 20)
    assert list(receiver.handle_deadline(now=2 * PATIENCE)) == []


def test_an_id_that_is_used_again_begins_another_text() -> None:
    receiver = TextReceiver()
    said = words(receiver, long(120)[0], *long(80, letter="b"))
    assert said == ["a" * 50 + "[…]", "b" * 80]


def test_what_is_kept_is_bounded() -> None:
    receiver = TextReceiver()
    given_up = [words(receiver, long(60, text_id=number)[0]) for number in range(1, 100)]
    assert sum(map(len, given_up)) == 99 - MOST_OPEN
    assert repr(receiver) == f"TextReceiver({MOST_OPEN} open)"


def test_a_text_without_an_end_is_cut() -> None:
    receiver = TextReceiver()
    endless = [Statustext(6, b"a" * 50, 3, number) for number in range(MOST_CHUNKS + 1)]
    assert words(receiver, *endless) == ["a" * 50 * MOST_CHUNKS + "[…]"]


def test_a_text_of_which_only_what_is_cut_has_come_does_no_harm() -> None:
    receiver = TextReceiver()
    for number in (MOST_CHUNKS, 255):
        assert words(receiver, Statustext(6, b"a" * 50, 3, number)) == ["[…]"]
    assert receiver.next_deadline() == inf


def test_bytes_that_are_no_text_and_severities_that_are_none_do_no_harm() -> None:
    (text,) = TextReceiver().receive(ROVER, Statustext(200, b"\xff\xfe"), now=0.0)
    assert text == (ROVER, MavSeverity.DEBUG, "\ufffd\ufffd")
