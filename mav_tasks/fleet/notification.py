"""The text of a notification between gateways: datagrams in a packet with a tag.

Any role of the database can notify any channel, so each packet is authenticated with a key of the
fleet. The tag also covers the session that the packet is for. That is a random number, which
changes whenever its gateway begins to listen: what was recorded earlier is not valid any more. It
is not in the packet; only a HELLO, which is for all, is for no session. Nothing is encrypted.

::

  kind (1)  session of the sender (16)  counter (8)  number (8)  sent (8)  since (8)  taken (8)
  length of the name (1)  name  [length, with FIRST (2)  age (2)  time left (2)  payload] …
  tag (16)
"""

import struct
from binascii import Error, a2b_base64, b2a_base64
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from hashlib import blake2b
from hmac import compare_digest
from math import ceil, inf

SESSION = 16  # bytes
NOBODY = bytes(SESSION)  # the session that a HELLO is for
LONGEST = 400  # bytes of a datagram
EACH = 6  # bytes before each datagram
_TEXT = 7_996  # characters; PostgreSQL takes less than 8,000
_BYTES = _TEXT // 4 * 3
_HEAD = struct.Struct(">B16sQQQQQB")
_BEFORE = struct.Struct(">HHH")
_FIRST = 0x8000
_FOREVER = 0xFFFF  # ms
_TAG = 16
_CHANNEL = "mav_tasks_"


class Kind(IntEnum):
    """What a packet is."""

    HELLO = 1  # to all: I listen; no datagrams
    MAIL = 2


@dataclass(frozen=True, slots=True)
class Datagram:
    """A datagram in a packet; ``age`` and ``left`` are seconds before and after its packing.

    ``left``: how long it is of use; inf: always.
    """

    payload: bytes
    age: float = 0.0
    left: float = inf
    first: bool = False


@dataclass(frozen=True, slots=True)
class Packet:
    """What one gateway says to another one.

    - ``session``: of the sender, also the one that answers are for.
    - ``counter``: rises with each packet of the session.
    - ``number``: counts the packets for the receiver, over all sessions; 0: not this one.
    - ``sent``: microseconds on the sender's clock, when it was packed.
    - ``since``: microseconds on the receiver's clock: it was packed then or later. 0: unknown.
    - ``taken``: the highest counter of the receiver's session that the sender has taken.
    """

    kind: Kind
    name: str
    session: bytes
    counter: int
    number: int = 0
    sent: int = 0
    since: int = 0
    taken: int = 0
    datagrams: Sequence[Datagram] = ()


class Seal:
    """The fleet's key, which makes and checks tags, and names channels."""

    def __init__(self, secret: bytes, fleet: str) -> None:
        """``fleet``: the id of the database's fleet."""
        self._fleet = fleet.encode()
        self._key = blake2b(self._fleet, key=blake2b(secret).digest(), person=b"carrier").digest()

    def __repr__(self) -> str:
        return f"Seal({self._fleet.decode()})"

    def channel(self, name: str) -> str:
        """Return the channel of a gateway, or of all ("")."""
        return _CHANNEL + blake2b(self._fleet + b"\0" + name.encode(), digest_size=16).hexdigest()

    def text(self, packet: Packet, to: bytes) -> str:
        """Return the notification for a session."""
        body = _packed(packet)
        return b2a_base64(body + self._tag(to, body), newline=False).decode()

    def packet(self, text: str, to: bytes) -> Packet | None:
        """Return a notification's packet; None: this fleet has not made it for this session."""
        try:
            data = a2b_base64(text.encode(), strict_mode=True)
        except (Error, UnicodeEncodeError):
            return None
        body, tag = data[:-_TAG], data[-_TAG:]
        if len(body) < _HEAD.size:
            return None
        meant = NOBODY if body[0] == Kind.HELLO else to
        return _unpacked(body) if compare_digest(tag, self._tag(meant, body)) else None

    def _tag(self, to: bytes, body: bytes) -> bytes:
        return blake2b(to + body, key=self._key, digest_size=_TAG).digest()


def room_for(name: str) -> int:
    """Return how many bytes the datagrams of a packet may have, with EACH before each of them."""
    return _BYTES - _HEAD.size - len(name.encode()) - _TAG


def _packed(packet: Packet) -> bytes:
    name = packet.name.encode()
    numbers = packet.counter, packet.number, packet.sent, packet.since, packet.taken
    parts = [_HEAD.pack(packet.kind, packet.session, *numbers, len(name)), name]
    for each in packet.datagrams:
        length = len(each.payload) | (_FIRST if each.first else 0)
        parts += [_BEFORE.pack(length, _milliseconds(each.age), _milliseconds(each.left))]
        parts += [each.payload]
    return b"".join(parts)


def _unpacked(body: bytes) -> Packet | None:
    """Return the packet; None if a newer version has made it in another form."""
    try:
        kind, session, counter, number, sent, since, taken, length = _HEAD.unpack_from(body)
        at = _HEAD.size + length
        name = body[_HEAD.size : at].decode()
        datagrams: list[Datagram] = []
        while at < len(body):
            size, age, left = _BEFORE.unpack_from(body, at)
            at += EACH
            payload = body[at : at + (size & ~_FIRST)]
            at += len(payload)
            datagrams.append(Datagram(payload, _seconds(age), _seconds(left), bool(size & _FIRST)))
        return Packet(Kind(kind), name, session, counter, number, sent, since, taken, datagrams)
    except (struct.error, ValueError):
        return None


def _seconds(milliseconds: int) -> float:
    return inf if milliseconds == _FOREVER else milliseconds / 1000


def _milliseconds(seconds: float) -> int:
    """Return at least so many milliseconds, in 16 bits; what is too long counts as for ever."""
    return _FOREVER if seconds * 1000 >= _FOREVER else max(0, ceil(seconds * 1000))
