"""Logs who sends bytes on a vehicle link, but never a whole packet, as an observer of the engine.

A wrong baud rate looks like that, and a port on which a rover speaks another protocol.
"""

import logging
from dataclasses import dataclass

from mav_tasks.engine.inputs import Input, Packets, Peer, PeerChanged
from mav_tasks.mavlink.codec import crc_fits
from mav_tasks.mavlink.stream import PeerStreams
from mav_tasks.shell.logs.link_observer import LinkObserver

WITHIN = 5.0  # s in which a rover has sent several packets, whatever its link
ENOUGH = 32  # bytes; less may be noise of a line on which nobody speaks
MOST_PEERS = 256  # remembered; one more clears all, and they are looked at again

log = logging.getLogger("mav_tasks")


@dataclass(slots=True)
class _Peer:
    """What came from one peer, until it is known to send packets or was logged."""

    stream: PeerStreams
    since: float
    count: int = 0
    is_known: bool = False


class Unreadable(LinkObserver):
    """Implements ``EngineObserver``."""

    def __init__(self) -> None:
        super().__init__()
        self._peers: dict[tuple[str, Peer], _Peer] = {}

    def look(self, item: Input | None, *, now: float) -> None:
        """Look at what vehicle links deliver."""
        match item:
            case Packets() if item.link in self._links:
                for peer, data in item.datagrams:
                    known = self._peers.get((item.link, peer))
                    if known is None or not known.is_known:
                        self._count(item.link, peer, data, now)
            case PeerChanged():
                self._peers.pop((item.link, item.peer), None)

    def _count(self, link: str, peer: Peer, data: bytes, now: float) -> None:
        if len(self._peers) >= MOST_PEERS:
            self._peers.clear()
        streams = PeerStreams(is_stream=self._links[link])
        it = self._peers.setdefault((link, peer), _Peer(streams, since=now))
        it.count += len(data)
        if any(map(crc_fits, it.stream.feed(peer, data, now=now))):
            it.is_known = True
        elif now - it.since >= WITHIN and it.count >= ENOUGH:
            it.is_known = True
            source = f" from {peer[0]}:{peer[1]}" if isinstance(peer, tuple) else ""
            log.warning(
                "link %s: %d bytes came%s in %.0f s, and not one whole MAVLink packet:"
                " check the baud rate, and that the port speaks MAVLink",
                link,
                it.count,
                source,
                now - it.since,
            )
