"""STATUSTEXT: our texts cut into chunks, and those of others joined. MAVLink common.

A text of others that never becomes whole is given as far as it came.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Statustext

PATIENCE = 2.0  # s, from the first chunk that came to the last
MOST_OPEN = 32  # texts not whole yet; the oldest is given up for one more
MOST_CHUNKS = 20  # of one text: 1000 bytes; a longer one is cut
GAP = "[…]"  # stands for what did not come


class Text(NamedTuple):
    """A text of a sender, as whole as it came."""

    sender: Address
    severity: MavSeverity
    words: str


@dataclass(slots=True)
class _Open:
    severity: int
    until: float
    chunks: dict[int, bytes] = field(default_factory=dict)
    last: int | None = None  # number of the chunk that ends it, once it came

    @property
    def is_whole(self) -> bool:
        return self.last is not None and all(n in self.chunks for n in range(self.last + 1))

    @property
    def words(self) -> str:
        end = max(self.chunks, default=-1) if self.last is None else self.last
        pieces = b""
        for number in range(end + 1):
            pieces += self.chunks.get(number, GAP.encode())
        return _words(pieces) + (GAP if self.last is None else "")


class TextReceiver:
    """Joins chunks of any number of senders. ``now`` in seconds of a clock that only goes on."""

    def __init__(self) -> None:
        self._open: dict[tuple[Address, int], _Open] = {}  # the oldest first

    def __repr__(self) -> str:
        return f"TextReceiver({len(self._open)} open)"

    def receive(self, sender: Address, message: Statustext, *, now: float) -> Iterator[Text]:
        """Take a message in; gives the texts that are whole, or given up, with it."""
        data = message._text_raw.partition(b"\0")[0]
        if message.id == 0:
            yield Text(sender, _severity(message.severity), _words(data))
            return
        key, number = (sender, message.id), message.chunk_seq
        text = self._open.get(key)
        if text is not None and text.chunks.get(number, data) != data:  # the id is used again
            yield self._end(key)
            text = None
        if text is None:
            if len(self._open) >= MOST_OPEN:
                yield self._end(next(iter(self._open)))
            text = self._open[key] = _Open(message.severity, now + PATIENCE)
        if number < MOST_CHUNKS:
            text.chunks[number] = data
            if len(data) < CHUNK:
                text.last = number
        if text.is_whole or number >= MOST_CHUNKS:
            yield self._end(key)

    def next_deadline(self) -> float:
        """Return when ``handle_deadline`` gives a text up; inf: none is open."""
        return next((text.until for text in self._open.values()), inf)

    def handle_deadline(self, *, now: float) -> Iterator[Text]:
        """Yield the texts that are not waited for any longer."""
        while self._open and now >= self.next_deadline():
            yield self._end(next(iter(self._open)))

    def _end(self, key: tuple[Address, int]) -> Text:
        text = self._open.pop(key)
        return Text(key[0], _severity(text.severity), text.words)


def _words(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def _severity(number: int) -> MavSeverity:
    """A number that there is no severity of is as good as debug."""
    return MavSeverity(min(number, MavSeverity.DEBUG))


CHUNK = 50  # bytes of text a message
BURST = 10  # texts, before the rate counts


def chunks(severity: MavSeverity, text: str, *, text_id: int) -> list[Statustext]:
    """Return the messages that carry a text of any length.

    ``text_id`` 1–65535 ties the chunks of a long text together; a short one is sent with id 0. A
    tab at the end is cut: QGroundControl drops such texts of a PX4 vehicle.
    """
    data = text.rstrip().encode("ascii", errors="replace")
    if len(data) <= CHUNK:
        return [Statustext(severity, data)]
    ends = len(data) // CHUNK + 1  # a text ends with a chunk that is not full, if need be an empty
    return [
        Statustext(severity, data[number * CHUNK : (number + 1) * CHUNK], text_id, number)
        for number in range(ends)
    ]
