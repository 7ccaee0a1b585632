import pytest

from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.services.statustext import CHUNK, chunks

WARNING = MavSeverity.WARNING


def sent(text: str) -> list[tuple[bytes, int, int]]:
    """(bytes, id, chunk number) of each message of a text."""
    return [(c._text_raw, c.id, c.chunk_seq) for c in chunks(WARNING, text, text_id=7)]


@pytest.mark.parametrize("length", [0, 1, CHUNK - 1, CHUNK])
def test_a_text_that_fits_is_one_message_without_an_id(length: int) -> None:
    assert sent("x" * length) == [(b"x" * length, 0, 0)]


def test_a_long_text_is_cut_into_numbered_chunks() -> None:
    text = "a" * CHUNK + "b" * CHUNK + "c" * 3
    assert sent(text) == [(b"a" * CHUNK, 7, 0), (b"b" * CHUNK, 7, 1), (b"ccc", 7, 2)]


def test_a_long_text_ends_with_a_chunk_that_is_not_full() -> None:
    assert sent("x" * (2 * CHUNK)) == [(b"x" * CHUNK, 7, 0), (b"x" * CHUNK, 7, 1), (b"", 7, 2)]


def test_a_tab_at_the_end_is_cut_off() -> None:
    assert sent("too fast\t") == [(b"too fast", 0, 0)]


def test_what_is_not_ascii_becomes_question_marks() -> None:
    assert sent("90° left") == [(b"90? left", 0, 0)]


def test_every_chunk_has_the_severity() -> None:
    assert {c.severity for c in chunks(WARNING, "x" * 120, text_id=1)} == {WARNING}
