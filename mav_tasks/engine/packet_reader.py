"""Splits what links deliver into packets. A datagram stands alone; a stream is continued."""

from itertools import repeat

from mav_tasks.engine.inputs import LinkChanged, Packets, Peer, PeerChanged
from mav_tasks.mavlink.codec import DecodeCounts
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.stream import StreamSplitter

MAX_STREAMS = 256  # per link; one more replaces the oldest


class PacketReader:
    """The unfinished packets of every stream."""

    def __init__(self) -> None:
        self._streams: dict[str, dict[Peer, StreamSplitter]] = {}

    def __repr__(self) -> str:
        return f"PacketReader({self._streams})"

    def change_link(self, change: LinkChanged) -> None:
        """Note whether a link delivers datagrams or streams."""
        if change.up and change.is_stream:
            self._streams[change.link] = {}
        else:
            self._streams.pop(change.link, None)

    def change_peer(self, change: PeerChanged) -> None:
        """Drop what a peer left unfinished: a new connection starts a new packet."""
        self._streams.get(change.link, {}).pop(change.peer, None)

    def packets(
        self, item: Packets, counts: DecodeCounts, *, now: float
    ) -> list[tuple[Peer, Packet, float]]:
        """Return (sender, packet, its arrival) for each packet, in order.

        Bytes that belong to no packet go to ``counts``.
        """
        streams = self._streams.get(item.link)
        taken: list[tuple[Peer, Packet, float]] = []
        for (peer, data), arrived in zip(item.datagrams, item.arrived or repeat(now), strict=False):
            if streams is None:
                packets = split_datagram(data)
                if len(packets) != 1 or len(packets[0].raw) != len(data):
                    counts.noise += len(data) - sum(len(packet.raw) for packet in packets)
            else:
                splitter = _splitter(streams, peer)
                before = splitter.noise
                packets = splitter.feed(data, now=now)
                counts.noise += splitter.noise - before
            for packet in packets:
                taken.append((peer, packet, arrived))  # noqa: PERF401  # nearly always one
        return taken


def _splitter(streams: dict[Peer, StreamSplitter], peer: Peer) -> StreamSplitter:
    splitter = streams.get(peer)
    if splitter is None:
        if len(streams) >= MAX_STREAMS:
            del streams[next(iter(streams))]
        splitter = streams[peer] = StreamSplitter()
    return splitter
