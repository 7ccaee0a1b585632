"""MAVLink 2 signing: who signed a packet, whether it is news, and signatures of our own. Pure.

A signature is 13 bytes behind the CRC: link id, 48 bits of time in 10 µs since 2015, and the first
48 bits of SHA-256 over key and packet. It says who sent, not that nobody reads. MAVLink guide,
"Message Signing (Authentication)".
"""

from dataclasses import dataclass, field
from hashlib import sha256
from hmac import compare_digest
from math import inf
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

    ``limits`` are its own ``settings.Limits``, beside those of the role; None: no others.
    A key is recognised by its ``fingerprint``, which gives nothing of the secret away. One without
    a secret was revoked: nobody signs with it any more.
    """

    name: str
    secret: bytes = field(repr=False)
    role: str = ""
    fingerprint: str = ""
    limits: object = None

    def __post_init__(self) -> None:
        if not self.fingerprint:
            object.__setattr__(self, "fingerprint", fingerprint_of(self.secret))


class Stream(NamedTuple):
    """What has a time of its own among the packets signed with one key."""

    link_id: int
    source: Address


def fingerprint_of(secret: bytes) -> str:
    """Return 16 hexadecimal digits by which a key is recognised."""
    return sha256(b"mav-tasks fingerprint" + secret).hexdigest()[:16]


def timestamp_at(utc: float) -> int:
    """Return the time of a signature at UTC seconds since 1970; none before 2015."""
    return min(max(0, int((utc - EPOCH) * UNITS)), HIGHEST_TIMESTAMP)


def stream_of(packet: Packet) -> Stream:
    """Return the stream that a signed packet belongs to."""
    return Stream(packet.raw[-SIGNATURE_LENGTH], packet.source)


def timestamp_of(packet: Packet) -> int:
    """Return the time of a signed packet, in 10 µs since 2015."""
    return int.from_bytes(packet.raw[1 - SIGNATURE_LENGTH : -DIGEST_LENGTH], "little")


def is_signed_with(packet: Packet, secret: bytes) -> bool:
    """Whether a signed packet was signed with a key."""
    raw = packet.raw
    digest = sha256(secret + raw[:-DIGEST_LENGTH]).digest()
    return compare_digest(digest[:DIGEST_LENGTH], raw[-DIGEST_LENGTH:])


def signed(raw: bytes, secret: bytes, *, link_id: int, timestamp: int) -> bytes:
    """Return an unsigned packet with a signature; MAVLink 1 has none, and is given as it is."""
    if raw[0] != MAGIC_V2:
        return raw
    told = with_flags(raw, raw[2] | SIGNED) + bytes((link_id,)) + timestamp.to_bytes(6, "little")
    return told + sha256(secret + told).digest()[:DIGEST_LENGTH]


class Window(NamedTuple):
    """Which times are believed: of anybody those from ``oldest`` to ``newest``.

    None is later than ``latest``, which is another time than ``newest`` only after our clock was
    set back. ``width`` is what a packet may be late, ``now`` in seconds of a clock that is never
    set. All else is in 10 µs.
    """

    oldest: int
    newest: int
    latest: int
    width: int
    now: float

    @classmethod
    def since(cls, oldest: int) -> "Window":
        """Return that of an end which believes whatever clock goes on, as autopilots do."""
        return cls(oldest, HIGHEST_TIMESTAMP, HIGHEST_TIMESTAMP, width=0, now=0.0)


class _Heard(NamedTuple):
    timestamp: int  # the last one that was accepted
    at: float  # seconds, when; -inf: in an earlier run


class StreamTimes:
    """The streams signed with one key: the time of each only goes on, and about as fast as ours.

    A stream begins within the window of the wall clock. From then on it may also be as far behind
    as it was, because its sender's clock is, or either clock was set; but what comes a window later
    after the packet before it than it was signed after that was held back. A sender that counts
    packets instead of time is believed as long as it is not silent for that long.

    A time beyond ``latest`` was kept by a version that believed every clock, or while ours was
    wrong: its stream begins again, or else nobody whose clock is right could use it any more.
    """

    def __init__(self) -> None:
        self._times: dict[Stream, _Heard] = {}
        self._forgotten = 0  # the newest of the streams that are not remembered any more

    def __repr__(self) -> str:
        return f"StreamTimes({len(self._times)} streams)"

    def is_news(self, stream: Stream, timestamp: int, window: Window) -> bool:
        """Return whether a packet is later than all before it, and neither old nor ahead."""
        is_fresh = window.oldest <= timestamp <= window.newest
        known = self._times.get(stream)
        if known is None or known.timestamp > window.latest:
            return is_fresh and timestamp > self._least(window)
        late = (window.now - known.at) * UNITS - (timestamp - known.timestamp)
        goes_on = late <= window.width and timestamp <= window.latest
        return timestamp > known.timestamp and (is_fresh or goes_on)

    def _least(self, window: Window) -> int:
        """Return the time that a stream must be later than to begin: it may be a forgotten one."""
        believed = [heard.timestamp for heard in self._times.values()]
        believed = [timestamp for timestamp in believed if timestamp <= window.latest]
        is_full = len(believed) >= MOST_STREAMS  # after a restart: what was forgotten was older
        return min(believed) if is_full else self._forgotten

    def note(self, stream: Stream, timestamp: int, window: Window) -> Stream | None:
        """A packet was accepted: none that is not later is, from here on.

        Return the stream that is forgotten for it, if one is; what is not later than that was is
        no news in any stream.
        """
        gone = None
        if stream not in self._times and len(self._times) >= MOST_STREAMS:
            gone = min(self._times, key=lambda each: self._age(each, window))
            forgotten = self._times.pop(gone).timestamp
            if forgotten <= window.latest:
                self._forgotten = max(self._forgotten, forgotten)
        self._times[stream] = _Heard(timestamp, window.now)
        return gone

    def _age(self, stream: Stream, window: Window) -> tuple[bool, int]:
        timestamp = self._times[stream].timestamp
        return timestamp <= window.latest, timestamp  # one that is not believed goes first

    def restore(self, stream: Stream, timestamp: int) -> None:
        """Take on what was accepted in an earlier run."""
        self._times[stream] = _Heard(timestamp, -inf)


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
        """Return a packet signed with this time, or with a later one if that was used."""
        self.last = min(max(clock, self.last + 1), HIGHEST_TIMESTAMP)
        return signed(raw, self.key.secret, link_id=self.link_id, timestamp=self.last)
