"""From what links give to packets: a datagram stands alone, a stream goes on where it stopped."""

from itertools import repeat

from mav_tasks.engine.inputs import LinkChanged, Packets, Peer, PeerChanged
from mav_tasks.mavlink.codec import DecodeCounts
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.stream import StreamSplitter

MAX_STREAMS = 256  # of one link; one more takes the place of the oldest


class PacketReader:
    """The unfinished packets of every stream."""

    def __init__(self) -> None:
        self._streams: dict[str, dict[Peer, StreamSplitter]] = {}

    def __repr__(self) -> str:
        return f"PacketReader({self._streams})"

    def change_link(self, change: LinkChanged) -> None:
        """Take note of how a link gives what it hears."""
        if change.up and change.is_stream:
            self._streams[change.link] = {}
        else:
            self._streams.pop(change.link, None)

    def change_peer(self, change: PeerChanged) -> None:
        """What a peer left unfinished has nothing to do with what comes next."""
        self._streams.get(change.link, {}).pop(change.peer, None)

    def packets(
        self, item: Packets, counts: DecodeCounts, *, now: float
    ) -> list[tuple[Peer, Packet, float | None]]:
        """Return the packets in order, each with its sender; counts what belongs to none.

        And for how long each has waited, in seconds; None: that was not measured.
        """
        streams = self._streams.get(item.link)
        taken: list[tuple[Peer, Packet, float | None]] = []
        for (peer, data), waited in zip(item.datagrams, item.waited or repeat(None), strict=False):
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
                taken.append((peer, packet, waited))  # noqa: PERF401  # nearly always one
        return taken


def _splitter(streams: dict[Peer, StreamSplitter], peer: Peer) -> StreamSplitter:
    splitter = streams.get(peer)
    if splitter is None:
        if len(streams) >= MAX_STREAMS:
            del streams[next(iter(streams))]
        splitter = streams[peer] = StreamSplitter()
    return splitter
