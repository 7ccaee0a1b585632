"""MAVLink 2 signing: who signed a packet, whether it is news, and signatures of our own. Pure.

A signature is 13 bytes behind the CRC: link id, 48 bits of time in 10 µs since 2015, and the first
48 bits of SHA-256 over key and packet. It says who sent, not that nobody reads. MAVLink guide,
"Message Signing (Authentication)".
"""

from dataclasses import dataclass, field
from hashlib import sha256
from hmac import compare_digest
from typing import NamedTuple

from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import MAGIC_V2, SIGNATURE_LENGTH, SIGNED, Packet, with_flags

EPOCH = 1_420_070_400.0  # UTC seconds of 2015-01-01
UNITS = 100_000.0  # of a timestamp, in a second
KEY_LENGTH = 32  # bytes
HIGHEST_TIMESTAMP = (1 << 48) - 1
DIGEST_LENGTH = 6
#: what a radio modem puts into the stream: RADIO_STATUS and RADIO. It knows no key
FROM_RADIOS = frozenset({109, 166})
MOST_STREAMS = 64  # remembered of one key; one more takes the place of the oldest


@dataclass(frozen=True, slots=True)
class Key:
    """A secret of 32 bytes that two ends share; ``role`` is what its holder may do.

    A key is recognised by its ``fingerprint``, which gives nothing of the secret away. One without
    a secret was revoked: nobody signs with it any more.
    """

    name: str
    secret: bytes = field(repr=False)
    role: str = ""
    fingerprint: str = ""

    def __post_init__(self) -> None:
        if not self.fingerprint:
            object.__setattr__(self, "fingerprint", fingerprint_of(self.secret))


class Stream(NamedTuple):
    """What has a time of its own among the packets signed with one key."""

    link_id: int
    source: Address


def fingerprint_of(secret: bytes) -> str:
    """Give 16 hexadecimal digits by which a key is recognised."""
    return sha256(b"mav-tasks fingerprint" + secret).hexdigest()[:16]


def timestamp_at(utc: float) -> int:
    """Give the time of a signature at UTC seconds since 1970; none before 2015."""
    return min(max(0, int((utc - EPOCH) * UNITS)), HIGHEST_TIMESTAMP)


def stream_of(packet: Packet) -> Stream:
    """Give the stream that a signed packet belongs to."""
    return Stream(packet.raw[-SIGNATURE_LENGTH], packet.source)


def timestamp_of(packet: Packet) -> int:
    """Give the time of a signed packet, in 10 µs since 2015."""
    return int.from_bytes(packet.raw[1 - SIGNATURE_LENGTH : -DIGEST_LENGTH], "little")


def is_signed_with(packet: Packet, secret: bytes) -> bool:
    """Whether a signed packet was signed with a key."""
    raw = packet.raw
    digest = sha256(secret + raw[:-DIGEST_LENGTH]).digest()
    return compare_digest(digest[:DIGEST_LENGTH], raw[-DIGEST_LENGTH:])


def signed(raw: bytes, secret: bytes, *, link_id: int, timestamp: int) -> bytes:
    """Give an unsigned packet with a signature; MAVLink 1 has none, and is given as it is."""
    if raw[0] != MAGIC_V2:
        return raw
    told = with_flags(raw, raw[2] | SIGNED) + bytes((link_id,)) + timestamp.to_bytes(6, "little")
    return told + sha256(secret + told).digest()[:DIGEST_LENGTH]


class StreamTimes:
    """The streams signed with one key: the time of each only goes on.

    A stream that is not known yet may begin up to a window behind the clock, and behind the newest
    time of this key: a sender's clock that is ahead is no reason to take older packets.
    """

    def __init__(self) -> None:
        self._times: dict[Stream, int] = {}
        self._newest = 0
        self._forgotten = 0  # the newest of the streams that are not remembered any more

    def __repr__(self) -> str:
        return f"StreamTimes({len(self._times)} streams, newest {self._newest})"

    def is_news(self, stream: Stream, timestamp: int, *, clock: int, window: int) -> bool:
        """Whether a packet of this time is later than all before it. ``window`` is in 10 µs."""
        known = self._times.get(stream)
        if known is not None:
            return timestamp > known
        oldest = max(clock, self._newest) - window
        is_full = len(self._times) >= MOST_STREAMS  # after a restart: what was forgotten was older
        forgotten = min(self._times.values()) if is_full else self._forgotten
        return timestamp >= oldest and timestamp > forgotten

    def note(self, stream: Stream, timestamp: int) -> Stream | None:
        """A packet was accepted: none that is not later is, from here on.

        Gives the stream that is forgotten for it, if one is; what is not later than that was is no
        news in any stream.
        """
        gone = None
        if stream not in self._times and len(self._times) >= MOST_STREAMS:
            gone = min(self._times, key=lambda each: self._times[each])
            self._forgotten = max(self._forgotten, self._times.pop(gone))
        self._times[stream] = timestamp
        self._newest = max(self._newest, timestamp)
        return gone


class Signer:
    """Signs what goes to one endpoint, each packet later than the one before."""

    def __init__(self, key: Key, *, link_id: int) -> None:
        self.key = key
        self.link_id = link_id
        #: the time of the last signature, or of what the other end signed
        self.last = 0

    def __repr__(self) -> str:
        return f"Signer({self.key.name}, link {self.link_id})"

    def heard(self, timestamp: int) -> None:
        """The other end's clock is as late as this: it takes nothing that is far behind it."""
        self.last = max(self.last, timestamp)

    def sign(self, raw: bytes, *, clock: int) -> bytes:
        """Give a packet with a signature of this time, or a later one, as long as there is one."""
        self.last = min(max(clock, self.last + 1), HIGHEST_TIMESTAMP)
        return signed(raw, self.key.secret, link_id=self.link_id, timestamp=self.last)
