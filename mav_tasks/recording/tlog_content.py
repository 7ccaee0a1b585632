"""Selects the packets of a telemetry log: every packet once, as far as possible.

The log has all packets received from vehicles and clients, and all packets sent to vehicles. Of the
packets sent to clients it has only the server's own: forwarded telemetry was logged when received.
SETUP_SIGNING is left out: it has a key, and people send logs to each other.
"""

import struct
from collections.abc import Iterator, Sequence

from mav_tasks.engine import inputs
from mav_tasks.engine.inputs import Input, LinkSide, Outgoing, Packets, Peer
from mav_tasks.engine.packets import PacketReader
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.codec import DecodeCounts, crc_fits
from mav_tasks.mavlink.packet import HEADER_V1, HEADER_V2, MAGIC_V2

_stamped = struct.Struct(">Q").pack  # microseconds since 1970


class TlogContent:
    """Converts the engine's inputs and outputs to log entries: packets with their times."""

    def __init__(self, *, component_id: int) -> None:
        """``component_id``: the server's."""
        self._component_id = component_id
        self._intake = PacketReader()
        self._counts = DecodeCounts()  # unused: the engine counts for itself
        self._vehicle_links: set[str] = set()
        self._wall_offset = 0.0
        self._now = 0.0
        self._heard: set[bytes] = set()  # vehicles' packets at ``_now``, as of ``_words``

    def utc(self, now: float) -> float:
        """Return the wall clock's time, seconds since 1970."""
        return now + self._wall_offset

    def of_input(self, item: Input, *, now: float) -> Iterator[bytes]:
        match item:
            case Packets():
                yield from self._received(item, now=now)
            case inputs.WallClock(offset=offset):
                self._wall_offset = offset
            case inputs.LinkChanged(link=link, side=side):
                self._intake.change_link(item)
                if side is LinkSide.VEHICLES:
                    self._vehicle_links.add(link)
            case inputs.PeerChanged():
                self._intake.change_peer(item)

    def of_output(self, packets: Sequence[Outgoing], *, now: float) -> Iterator[bytes]:
        when = self._when(now)
        told: dict[bytes, tuple[str, Peer]] = {}
        for link, peer, data, *_ in packets:
            if link in self._vehicle_links or self._is_news(data, (link, peer), told):
                yield when + data

    def _received(self, item: Packets, *, now: float) -> Iterator[bytes]:
        if now != self._now:
            self._now = now
            self._heard.clear()
        when = self._when(now)
        from_vehicles = item.link in self._vehicle_links
        for _, packet, _ in self._intake.packets(item, self._counts, now=now):
            if packet.message_id != m.SetupSigning.id and crc_fits(packet):
                if from_vehicles:
                    self._heard.add(_words(packet.raw))
                yield when + packet.raw

    def _is_news(
        self, data: bytes, to: tuple[str, Peer], told: dict[bytes, tuple[str, Peer]]
    ) -> bool:
        """Whether a packet to a client is the server's own, and no copy of one to another client.

        The server sends some packets, such as answers, as the autopilot. A heartbeat as the
        autopilot is always forwarded: sometimes changed, or repeated for a new client.
        """
        component_id, message_id = _head(data)
        words = _words(data)
        if component_id != self._component_id and (
            message_id == m.Heartbeat.id or words in self._heard
        ):
            return False
        return message_id in m.TARGETED or told.setdefault(words, to) == to

    def _when(self, now: float) -> bytes:
        return _stamped(max(0, round(self.utc(now) * 1e6)))


def _head(raw: bytes) -> tuple[int, int]:
    """Return a packet's component id and message id."""
    if raw[0] == MAGIC_V2:
        return raw[6], raw[7] | raw[8] << 8 | raw[9] << 16
    return raw[4], raw[5]


def _words(raw: bytes) -> bytes:
    """Return a packet's source, message id and payload: the parts that forwarding never changes."""
    if raw[0] == MAGIC_V2:
        return raw[5 : HEADER_V2 + raw[1]]
    return raw[3 : HEADER_V1 + raw[1]]
