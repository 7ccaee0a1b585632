"""MAVLink 2 signing of a rover with a key: it signs every packet, and drops unsigned ones.

It has no SETUP_SIGNING: the key is there from the start. Radio status may be unsigned.
"""

from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.signing import (
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

WINDOW = int(60 * UNITS)  # "more than 1 minute", MAVLink guide, "Accepting Signed Packets"
FROM_RADIOS = frozenset({109, 166})
LINK_ID = 0


class RoverSignatures:
    """Signs and verifies packets of one rover; ``unix_offset`` is Unix time minus ``now``."""

    def __init__(self, key: Key, *, unix_offset: float) -> None:
        self._key = key
        self._unix_offset = unix_offset
        self._signer = Signer(key, link_id=LINK_ID)
        self._times = StreamTimes()

    def sealed(self, raw: bytes, *, now: float) -> bytes:
        """Return a packet signed."""
        return self._signer.sign(raw, clock=self._clock(now))

    def believes(self, packet: Packet, *, now: float) -> bool:
        """Return whether to accept a packet."""
        if not packet.is_signed:
            return packet.message_id in FROM_RADIOS
        if not is_signed_with(packet, self._key.secret):
            return False
        stream, timestamp = stream_of(packet), timestamp_of(packet)
        window = Window.since(self._clock(now) - WINDOW)
        if not self._times.is_news(stream, timestamp, window):
            return False
        self._times.note(stream, timestamp, window)
        self._signer.heard(timestamp)
        return True

    def _clock(self, now: float) -> int:
        return timestamp_at(now + self._unix_offset)
