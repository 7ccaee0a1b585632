"""What helps where a link does not work as it should: who is heard at all, and how much is useless.

An observer, for ``--verbose`` only: what it tells is no event, and nobody acts on it.
"""

import logging
from collections.abc import Callable, Sequence
from math import inf

from mav_tasks.engine.inputs import (
    AtOnce,
    Backlog,
    Congestion,
    Input,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    Peer,
    PeerChanged,
)
from mav_tasks.tasks.events import Event

PERIOD = 60.0  # s, between two counts
MOST_PEERS = 256  # remembered; with one more all are forgotten, and told anew

log = logging.getLogger("mav_tasks")


class FieldNotes:
    """Implements ``EngineObserver``. ``counts`` gives what came in so far, in words."""

    def __init__(self, counts: Callable[[], str]) -> None:
        self._counts = counts
        self._count_at = -inf
        self._sides: dict[str, LinkSide] = {}
        self._heard: set[tuple[str, Peer]] = set()

    def __repr__(self) -> str:
        return f"FieldNotes({len(self._heard)} heard)"

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Take note of who is new."""
        match item:
            case AtOnce(packets=several) | Backlog(packets=several):
                for each in several:
                    self.on_input(each, now=now)
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
                state = "takes all again" if not item.is_congested else "does not take all we send"
                log.debug("link %s: %s %s", item.link, _name(item.peer), state)
        if now >= self._count_at:
            if self._count_at > -inf:
                log.debug("came in: %s", self._counts())
            self._count_at = now + PERIOD

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Take no note: what the engine does is in its events."""

    def close(self) -> None:
        """Say in the end how much came in."""
        log.debug("came in: %s", self._counts())

    def _meet(self, link: str, peer: Peer) -> None:
        if len(self._heard) >= MOST_PEERS:
            self._heard.clear()
        self._heard.add((link, peer))
        side = self._sides.get(link, LinkSide.CLIENTS).name.lower()
        log.debug("link %s for %s: first bytes from %s", link, side, _name(peer))


def _name(peer: Peer) -> str:
    return f"{peer[0]}:{peer[1]}" if isinstance(peer, tuple) and len(peer) >= 2 else str(peer)
