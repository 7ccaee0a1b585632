"""Texts of a task on the wire: UTF-8 in pieces of up to 8 bytes, in x and y of a COMMAND_INT.

A command has no text, but two integers that keep every bit. A piece holds whole characters and
names the byte of the text at which it begins; bytes behind it are removed. So a piece that comes
twice changes nothing, and a label can be read after each piece.
"""

from typing import NamedTuple

MAX_LABEL = 24  # bytes
PIECE = 8


class Piece(NamedTuple):
    """Up to 8 bytes of a text, as two little-endian integers, and the byte where they begin."""

    offset: int
    x: int
    y: int


def check_label(label: str) -> None:
    """Raise ValueError for a label that a task cannot have."""
    if len(label.encode()) > MAX_LABEL:
        raise ValueError(f"label {label!r}: at most {MAX_LABEL} bytes of UTF-8")
    if not label.isprintable() or label != label.strip():
        raise ValueError(f"label {label!r}: printable characters, no space at either end")


def text_pieces(text: str) -> list[Piece]:
    """Return the pieces of a text to be sent, in order; an empty text is one empty piece."""
    pieces, offset, data = [], 0, b""
    for character in map(str.encode, text):
        if len(data) + len(character) > PIECE:
            pieces.append(_piece(offset, data))
            offset, data = offset + len(data), b""
        data += character
    return [*pieces, _piece(offset, data)]


def with_piece(text: str, piece: Piece, *, name: str = "label", most: int = MAX_LABEL) -> str:
    """Return a text with a piece put in. ValueError if it does not fit, or makes no text.

    ``name`` is the text's in errors; ``most`` its bytes.
    """
    known = text.encode()
    if piece.offset > len(known):
        raise ValueError(f"{name}: byte {piece.offset} comes after byte {len(known)}")
    data = b"".join(n.to_bytes(4, "little", signed=True) for n in (piece.x, piece.y))
    try:
        whole = (known[: piece.offset] + data.rstrip(b"\0")).decode()
    except UnicodeDecodeError:
        raise ValueError(f"{name}: not UTF-8") from None
    if len(whole.encode()) > most:
        raise ValueError(f"{name}: more than {most} bytes")
    if not whole.isprintable():
        raise ValueError(f"{name}: a character that cannot be printed")
    return whole


def _piece(offset: int, data: bytes) -> Piece:
    filled = data.ljust(PIECE, b"\0")
    return Piece(
        offset,
        int.from_bytes(filled[:4], "little", signed=True),
        int.from_bytes(filled[4:], "little", signed=True),
    )
