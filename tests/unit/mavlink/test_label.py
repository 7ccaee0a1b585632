"""A label goes over the wire in pieces, and is whole and readable at each step."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.mavlink.label import MAX_LABEL, PIECE, Piece, check_label, text_pieces, with_piece

INT32 = range(-(2**31), 2**31 - 1)  # the largest of them means "not given" in some clients

LABELS = st.text(max_size=MAX_LABEL).filter(
    lambda s: len(s.encode()) <= MAX_LABEL and s.isprintable() and s == s.strip()
)


@given(LABELS, LABELS)
def test_pieces_make_the_label_in_place_of_any_other(label: str, before: str) -> None:
    known = before
    for piece in text_pieces(label):
        assert piece.x in INT32
        assert piece.y in INT32
        known = with_piece(known, piece)
        assert label.startswith(known)
        assert with_piece(known, piece) == known, "a copy changes nothing"
    assert known == label


def test_a_label_of_plain_letters_takes_three_pieces_at_the_most() -> None:
    assert [piece.offset for piece in text_pieces("x" * MAX_LABEL)] == [0, PIECE, 2 * PIECE]
    assert text_pieces("") == [Piece(0, 0, 0)]
    assert text_pieces("ABCDEFGH") == [Piece(0, 0x44434241, 0x48474645)]


def test_what_is_no_label_is_named() -> None:
    for label in ("x" * 25, "ä" * 13, "two\nlines", " gap", "gap ", "\x07"):
        with pytest.raises(ValueError, match="label"):
            check_label(label)


def test_a_piece_that_makes_no_label_is_refused() -> None:
    for before, piece, words in (
        ("abc", Piece(4, 0x41, 0), "byte 4 comes after byte 3"),
        ("abc", Piece(0, -1, 0), "not UTF-8"),
        ("abc", Piece(0, 0x0A, 0), "cannot be printed"),
        ("abc", Piece(0, 0x41004141, 0), "cannot be printed"),
        ("x" * 20, Piece(20, 0x41414141, 0x41), "more than 24"),
    ):
        with pytest.raises(ValueError, match=words):
            with_piece(before, piece)
