"""Splits what links deliver into packets."""

from itertools import repeat

from mav_tasks.engine.inputs import LinkChanged, Packets, Peer, PeerChanged
from mav_tasks.mavlink.codec import DecodeCounts
from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.stream import PeerStreams


class PacketReader:
    """The unfinished packets of every link."""

    def __init__(self) -> None:
        self._links: dict[str, PeerStreams] = {}

    def __repr__(self) -> str:
        return f"PacketReader({self._links})"

    def change_link(self, change: LinkChanged) -> None:
        """Note whether a link delivers datagrams or streams."""
        self._links.pop(change.link, None)
        if change.up:
            self._links[change.link] = PeerStreams(is_stream=change.is_stream)

    def change_peer(self, change: PeerChanged) -> None:
        """Drop what a peer left unfinished: a new connection starts a new packet."""
        if link := self._links.get(change.link):
            link.forget(change.peer)

    def packets(
        self, item: Packets, counts: DecodeCounts, *, now: float
    ) -> list[tuple[Peer, Packet, float]]:
        """Return (sender, packet, its arrival) for each packet, in order.

        Bytes that belong to no packet go to ``counts``.
        """
        link = self._links.get(item.link)
        if link is None:
            link = self._links[item.link] = PeerStreams(is_stream=False)
        before = link.noise
        taken: list[tuple[Peer, Packet, float]] = []
        for (peer, data), arrived in zip(item.datagrams, item.arrived or repeat(now), strict=False):
            for packet in link.feed(peer, data, now=now):
                taken.append((peer, packet, arrived))  # noqa: PERF401  # nearly always one
        counts.noise += link.noise - before
        return taken
