"""Debug log for faulty links: the peers heard, and the counts of received packets.

An observer, for ``--verbose`` only: its messages are not events, and trigger nothing.
"""

import logging
from collections.abc import Callable
from math import inf

from mav_tasks.engine.inputs import (
    Congestion,
    Input,
    LinkChanged,
    LinkSide,
    Packets,
    Peer,
    PeerChanged,
)
from mav_tasks.shell.logs.link_observer import LinkObserver

PERIOD = 60.0  # s between two logs of the counts
MOST_PEERS = 256  # remembered; one more clears the set, and peers are logged again

log = logging.getLogger("mav_tasks")


class FieldNotes(LinkObserver):
    """Implements ``EngineObserver``. ``counts`` returns the counts of received packets as text."""

    def __init__(self, counts: Callable[[], str]) -> None:
        super().__init__()
        self._counts = counts
        self._count_at = -inf
        self._sides: dict[str, LinkSide] = {}
        self._heard: set[tuple[str, Peer]] = set()

    def __repr__(self) -> str:
        return f"FieldNotes({len(self._heard)} heard)"

    def look(self, item: Input | None, *, now: float) -> None:
        """Log new peers, new links and congestion; log the counts every PERIOD."""
        match item:
            case Packets(link=link):
                for peer, _ in item.datagrams:
                    if (link, peer) not in self._heard:
                        self._meet(link, peer)
            case LinkChanged():
                self._sides[item.link] = item.side
                log.debug("link %s for %s", item.link, item.side.name.lower())
            case PeerChanged():
                self._heard.discard((item.link, item.peer))
            case Congestion():
                state = "is congested" if item.is_congested else "is no longer congested"
                log.debug("link %s: %s %s", item.link, _name(item.peer), state)
        if now >= self._count_at:
            if self._count_at > -inf:
                log.debug("received so far: %s", self._counts())
            self._count_at = now + PERIOD

    def close(self) -> None:
        """Log the final counts."""
        log.debug("received so far: %s", self._counts())

    def _meet(self, link: str, peer: Peer) -> None:
        if len(self._heard) >= MOST_PEERS:
            self._heard.clear()
        self._heard.add((link, peer))
        side = self._sides.get(link, LinkSide.CLIENTS).name.lower()
        log.debug("link %s for %s: first bytes from %s", link, side, _name(peer))


def _name(peer: Peer) -> str:
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) and len(peer) >= 2 else str(peer)
