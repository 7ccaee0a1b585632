"""What a record tells up to a moment: who was heard with what, and what both cores have sent.

An entry of the table of intended differences may look at it, so that it explains a packet only
where that was called for: a word is older than a halt only if there was a halt.
"""

from binascii import Error, a2b_base64
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, NamedTuple

from .wire import HEADER_V1, HEADER_V2, MAGIC_V2, SIGNED, Layouts, Sent

KEPT = 60.0  # s: the longest that an entry asks about
STOOD_STILL = 0.5  # s without any input, while rovers stream
SIGNATURE, CRC = 13, 2  # bytes
MAGICS = (0xFE, MAGIC_V2)
OF_PACKETS = ("packets", "at once", "backlog")


class Heard(NamedTuple):
    """A packet that came in, and what it came in with."""

    at: float
    kind: str  # "packets", "at once", "backlog"
    packet: Sent

    @property
    def name(self) -> str:
        """Give the name of its message."""
        return self.packet.name

    def of(self, field_name: str) -> Any:
        """Give a field, None if it has none of that name."""
        return self.packet.fields.get(field_name)


class Story:
    """The last minute of a record, decoded only if it is asked for."""

    def __init__(self, layouts: Layouts, *, is_restart: bool) -> None:
        """``is_restart``: the server has run before."""
        self.is_restart = is_restart
        self.began: float | None = None
        self.silence = 0.0  # s, before this instant, in which nothing at all came in
        self.stood_until = -inf  # s, when a silence ended in which the server may have stood still
        self.wall_clock: float | None = None  # s since 1970, as of the last word of it
        self._now = 0.0
        self._layouts = layouts
        self._inputs: deque[tuple[float, Sequence[Any]]] = deque()
        self._decoded: dict[int, list[Heard]] = {}  # by the identity of the line, which is kept
        self._old: deque[tuple[float, Sent]] = deque()
        self._new: deque[tuple[float, Sent]] = deque()

    def took_in(self, line: Sequence[Any], *, now: float) -> None:
        """Note an input as it stands in the record."""
        if self.began is None:
            self.began = self._now = now
        if now > self._now:
            self.silence, self._now = now - self._now, now
            if self.silence > STOOD_STILL:
                self.stood_until = now
        if line[0] == "wall clock":
            self.wall_clock = float(line[2])
        if line[0] in OF_PACKETS:
            self._inputs.append((now, line))
            while self._inputs[0][0] < now - KEPT:
                self._decoded.pop(id(self._inputs.popleft()[1]), None)

    def sent(self, old: Sequence[Sent], new: Sequence[Sent], *, now: float) -> None:
        """Note what both cores sent."""
        for kept, packets in ((self._old, old), (self._new, new)):
            kept.extend((now, packet) for packet in packets)
            while kept and kept[0][0] < now - KEPT:
                kept.popleft()

    def heard(self, *names: str, since: float = -inf) -> Iterator[Heard]:
        """Give what came in, the last first; ``names`` of messages, none: all of them."""
        for now, line in reversed(self._inputs):
            if now < since:
                return
            for heard in reversed(self._of_line(now, line)):
                if not names or heard.name in names:
                    yield heard

    def old(self, *names: str, since: float = -inf) -> Iterator[tuple[float, Sent]]:
        """Give what the old core has sent before this moment, the last first."""
        return _lately(self._old, names, since)

    def new(self, *names: str, since: float = -inf) -> Iterator[tuple[float, Sent]]:
        """Give what the new core has sent before this moment, the last first."""
        return _lately(self._new, names, since)

    def _of_line(self, now: float, line: Sequence[Any]) -> list[Heard]:
        found = self._decoded.get(id(line))
        if found is None:
            found = self._decoded[id(line)] = list(_heard(now, line, self._layouts))
        return found


@dataclass(frozen=True, slots=True)
class Moment:
    """All that both cores sent at one instant, and what led to it."""

    old: Sequence[Sent] = ()
    new: Sequence[Sent] = ()
    story: Story = field(default_factory=lambda: Story({}, is_restart=False))


def _lately(
    packets: deque[tuple[float, Sent]], names: Sequence[str], since: float
) -> Iterator[tuple[float, Sent]]:
    for now, sent in reversed(packets):
        if now < since:
            return
        if not names or sent.name in names:
            yield now, sent


def _heard(now: float, line: Sequence[Any], layouts: Layouts) -> Iterator[Heard]:
    groups = [line[2:]] if line[0] == "packets" else line[2:]
    for link, pieces, *_ in groups:
        for peer, data in pieces:
            way = tuple(peer) if isinstance(peer, list) else peer
            try:
                raw = a2b_base64(data)
            except Error:
                continue
            for packet in _packets(raw):
                yield Heard(now, line[0], Sent(link, way, packet, False, layouts))


def _packets(data: bytes) -> Iterator[bytes]:
    """Give the whole packets of a datagram; a piece of a stream may begin or end within one."""
    while len(data) >= HEADER_V1:
        if data[0] not in MAGICS:
            data = data[1:]
            continue
        is_v2 = data[0] == MAGIC_V2
        length = data[1] + (HEADER_V2 if is_v2 else HEADER_V1) + CRC
        length += SIGNATURE if is_v2 and data[2] & SIGNED else 0
        if len(data) < length:
            return
        yield data[:length]
        data = data[length:]
