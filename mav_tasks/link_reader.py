"""Reads the readable links; after a stall of this process, all of them as one backlog.

A command that was sent before a STOP must not take effect after it because its link is read later.
After a stall the packets of all links are therefore returned together, each with its waiting time.
"""

import selectors
from collections.abc import Callable, Sequence
from itertools import chain
from math import inf

from mav_tasks.engine.inputs import FLEET_LINK, LinkSide, Packets, Peer
from mav_tasks.links.base import Link, PeerChange, PeerState, StampedLink, StreamLink

DRAIN = 64  # datagrams read from one link before the others have their turn
MOST_ROUNDS = 256  # of DRAIN from each link: more than the receive buffer of a UDP link holds
SETTLES = 0.5  # s after a stall, for which a stream's sender may still deliver stalled bytes

Note = Callable[[StreamLink, list[PeerChange]], None]


class LinkReader:
    """Reads links without waiting; calls ``note`` with peer changes, in order with the data.

    Times are of the server's clock.
    """

    def __init__(self, sides: Sequence[tuple[Link, LinkSide]], *, note: Note) -> None:
        self._note = note
        self._selector = selectors.DefaultSelector()
        for link, side in sides:
            self._selector.register(link.fileno(), selectors.EVENT_READ, (link, side))
        self._streams = {link.name: link for link, _ in sides if isinstance(link, StreamLink)}
        #: links on which each datagram tells how long it was under way
        self._stamped = {link.name for link, _ in sides if link.name == FLEET_LINK}
        self._gone: dict[str, tuple[StreamLink, list[PeerChange]]] = {}
        self._stood_still = 0.0  # s, length of the last stall
        self._settled_at = -inf

    def __repr__(self) -> str:
        return f"LinkReader({len(self._selector.get_map())} links)"

    def close(self) -> None:
        """Close the selector; the links stay open."""
        self._selector.close()

    def readable(self) -> tuple[list[Link], list[Link]]:
        """Return the readable links: those to clients, those to vehicles."""
        clients: list[Link] = []
        vehicles: list[Link] = []
        for key, _ in self._selector.select(0):
            link, side = key.data
            (clients if side is LinkSide.CLIENTS else vehicles).append(link)
        return clients, vehicles

    def read(self, link: Link, *, now: float) -> Packets:
        """Read one link. Call ``note_gone`` after the engine has handled the packets."""
        if link.name in self._stamped and isinstance(link, StampedLink):
            return Packets(link.name, *link.receive_stamped(DRAIN, longest=0.0))
        datagrams = self._received(link)
        waited: Sequence[float] = ()
        if now < self._settled_at and link.is_stream:
            waited = [self._stood_still] * len(datagrams)
            if len(datagrams) >= DRAIN:  # there is more
                self._settled_at = now + SETTLES
        return Packets(link.name, datagrams, waited)

    def read_late(self, seconds: float, *, wall_is_even: bool, now: float) -> tuple[Packets, ...]:
        """Read all links, clients' first, after a stall of so many seconds.

        If the wall clock was set during the stall (not ``wall_is_even``), kernel timestamps are
        useless: then everything counts as having waited for the whole stall. Other gateways'
        packets may have waited longer, and tell so by another clock.
        """
        self._stood_still, self._settled_at = seconds, now + SETTLES
        came: dict[str, tuple[list[tuple[Peer, bytes]], list[float]]] = {}
        for _ in range(MOST_ROUNDS):
            has_more = False
            for link in chain(*self.readable()):
                if link.name in self._gone:  # later data belongs to another connection
                    continue
                has_stamps = wall_is_even or link.name in self._stamped
                if has_stamps and isinstance(link, StampedLink):
                    datagrams, waited = link.receive_stamped(DRAIN, longest=seconds)
                else:
                    datagrams = self._received(link)
                    waited = [seconds] * len(datagrams)
                has_more |= bool(datagrams)
                all_datagrams, all_waited = came.setdefault(link.name, ([], []))
                all_datagrams += datagrams
                all_waited += waited
            if not has_more:
                break
        return tuple(Packets(name, *both) for name, both in came.items() if both[0])

    def note_gone(self) -> None:
        """Report the peers that went down, after their last data was handled."""
        gone, self._gone = self._gone, {}
        for link, changes in gone.values():
            self._note(link, changes)

    def _received(self, link: Link) -> list[tuple[Peer, bytes]]:
        stream = self._streams.get(link.name)
        if stream is None:
            return link.receive(DRAIN)
        while before := stream.take_changes():  # noting some may cause others
            self._note(stream, before)
        pieces = stream.receive(DRAIN)
        changes = stream.take_changes()
        self._note(stream, [change for change in changes if change.state is PeerState.UP])
        gone = [change for change in changes if change.state is not PeerState.UP]
        if gone:
            self._gone[link.name] = stream, gone
        return pieces
