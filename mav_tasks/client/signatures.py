"""MAVLink 2 signing for a client: sign every packet, accept only packets signed with the same key.

Timestamps come from the client's clock alone. A tick is 10 µs, so the timestamps of a new run are
past those of the last run by the time it has started. Each client has a random link id: two clients
with one key and address are two streams, and neither makes the other's packets old.
"""

from dataclasses import dataclass
from secrets import randbelow

from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.signing import (
    FROM_RADIOS,
    KEY_LENGTH,
    UNITS,
    Key,
    Signer,
    StreamTimes,
    Window,
    is_signed_with,
    stream_of,
    timestamp_at,
    timestamp_of,
)

WINDOW = int(60 * UNITS)  # the server's default


@dataclass(slots=True)
class NotBelieved:
    """Counts of received packets that were dropped."""

    unsigned: int = 0
    unknown: int = 0  # signed with another key
    old: int = 0  # valid signature, but a repeated or too old timestamp


class ClientSignatures:
    """Signs and verifies with one key. Times in seconds since 1970."""

    def __init__(self, key: Key | bytes, *, link_id: int | None = None) -> None:
        """``link_id`` 0 to 255, None: random. Raise ValueError if it or the key is invalid."""
        self.key = Key("", key) if isinstance(key, bytes) else key
        if len(self.key.secret) != KEY_LENGTH:
            raise ValueError(f"a key has {KEY_LENGTH} bytes, not {len(self.key.secret)}")
        if link_id is not None and not 0 <= link_id <= 255:
            raise ValueError(f"link_id {link_id}: not in 0..255")
        self._signer = Signer(self.key, link_id=randbelow(256) if link_id is None else link_id)
        self._times = StreamTimes()
        self.not_believed = NotBelieved()

    def __repr__(self) -> str:
        return f"ClientSignatures({self._named()}, {self.not_believed})"

    def sealed(self, raw: bytes, *, utc: float) -> bytes:
        """Return the packet with its signature.

        DEVIATION: the client does not adopt later timestamps of the server. Of two clients with one
        key, one that had heard the server would be ahead of the other.
        """
        return self._signer.sign(raw, clock=timestamp_at(utc))

    def believes(self, packet: Packet, *, utc: float) -> bool:
        """Return whether to accept a packet: signed with the key and new, or a radio modem's."""
        if not packet.is_signed:
            self.not_believed.unsigned += packet.message_id not in FROM_RADIOS
            return packet.message_id in FROM_RADIOS
        if not is_signed_with(packet, self.key.secret):
            self.not_believed.unknown += 1
            return False
        stream, timestamp = stream_of(packet), timestamp_of(packet)
        window = Window.since(timestamp_at(utc) - WINDOW)
        if not self._times.is_news(stream, timestamp, window):
            self.not_believed.old += 1
            return False
        self._times.note(stream, timestamp, window)
        return True

    def why_silent(self) -> str:
        """Return the likely reason, as text, why no packet was accepted."""
        heard = self.not_believed
        if heard.unknown:
            return f"the received packets are signed with another key than {self._named()}"
        if heard.old:
            return "the received packets are signed for another time: are both clocks right?"
        if heard.unsigned:
            return (
                f"the received packets are not signed: does the server have key {self._named()}, "
                "and are both clocks right?"
            )
        return f"does the server have key {self._named()}, and are both clocks right?"

    def _named(self) -> str:
        return f"{self.key.name} ({self.key.fingerprint})".lstrip()
