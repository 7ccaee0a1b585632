"""Reads the readable links, with the time at which each datagram arrived.

A command that was sent before a STOP must not take effect after it because its link is read later.
So the time of arrival counts, on whatever link, and not that of reading:

- The kernel stamps datagrams. Its stamps are of the wall clock, which may be set: after each step
  they count no more until the link was seen empty.
- What has no stamp, as the bytes of a stream, arrived after its link was last seen empty. That is
  the earliest time, for which a command to go on may be refused, but a halt is never undone.
"""

import selectors
import time
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from math import inf

from mav_tasks.engine.inputs import LinkSide, Packets, Peer
from mav_tasks.links.base import Link, PeerChange, PeerState, StampedLink, StreamLink, TimedLink

DRAIN = 64  # datagrams read from one link before the others have their turn
MOST_ROUNDS = 256  # of DRAIN from each link: more than the receive buffer of a UDP link holds
SETTLES = 0.5  # s after a stall, for which a stream's sender may still deliver stalled bytes
STEP = 1e-4  # s, a change of the wall clock's offset that is no inaccuracy of reading it

Note = Callable[[StreamLink, list[PeerChange]], None]


class LinkReader:
    """Reads links without waiting; calls ``note`` with peer changes, in order with the data.

    Times are of the server's clock, ``clock``.
    """

    def __init__(
        self, sides: Sequence[tuple[Link, LinkSide]], *, clock: Callable[[], float], note: Note
    ) -> None:
        self._note = note
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        for link, side in sides:
            self._selector.register(link.fileno(), selectors.EVENT_READ, (link, side))
        self._streams = {link.name: link for link, _ in sides if isinstance(link, StreamLink)}
        # looked up once: to ask a protocol takes longer than to read a datagram
        self._timed = {link.name: link for link, _ in sides if isinstance(link, TimedLink)}
        self._clients = {link.name for link, side in sides if side is LinkSide.CLIENTS}
        self._stamped = {
            link.name: link
            for link, side in sides
            if side is LinkSide.CLIENTS and isinstance(link, StampedLink)
        }
        self._gone: dict[str, tuple[StreamLink, list[PeerChange]]] = {}
        self._stalled_at, self._settled_at = inf, -inf  # the last stall
        self._offset = 0.0  # of the wall clock
        self._stepped_at = -inf  # when a step of it was seen
        self._look_at_clocks()
        self._empty_at = dict.fromkeys(self._clients, clock())  # when each was last seen empty

    def __repr__(self) -> str:
        return f"LinkReader({len(self._selector.get_map())} links)"

    def close(self) -> None:
        """Close the selector; the links stay open."""
        self._selector.close()

    def readable(self) -> tuple[list[Link], list[Link]]:
        """Return the readable links: those to clients, those to vehicles."""
        now = self._clock()
        clients: list[Link] = []
        vehicles: list[Link] = []
        for key, _ in self._selector.select(0):
            link, side = key.data
            (clients if side is LinkSide.CLIENTS else vehicles).append(link)
        full = {link.name for link in clients}
        for name in self._clients - full:
            self._empty_at[name] = now
        return clients, vehicles

    def look(self) -> None:
        """See which links are empty: what they bring from here on arrives from here on."""
        self._look_at_clocks()
        self.readable()

    def read(self, links: Iterable[Link], most: int = DRAIN) -> tuple[Packets, ...]:
        """Read up to ``most`` datagrams of each link; call ``note_gone`` once they are handled."""
        found = [(link, *self._received(link, most)) for link in links]
        self._look_at_clocks()
        return tuple(
            Packets(link.name, datagrams, self._arrivals(link, times, len(datagrams)))
            for link, datagrams, times in found
            if datagrams
        )

    def read_late(self, since: float) -> tuple[Packets, ...]:
        """Read all links, clients' first, after a stall that began then."""
        self._stalled_at, self._settled_at = since, self._clock() + SETTLES
        came: dict[str, tuple[list[tuple[Peer, bytes]], list[float]]] = {}
        for _ in range(MOST_ROUNDS):
            links = [each for each in chain(*self.readable()) if each.name not in self._gone]
            packets = self.read(links)  # later data of one that is gone is another connection's
            for each in packets:
                datagrams, arrived = came.setdefault(each.link, ([], []))
                datagrams += each.datagrams
                arrived += each.arrived
            if not packets:
                break
        return tuple(Packets(name, *both) for name, both in came.items())

    def note_gone(self) -> None:
        """Report the peers that went down, after their last data was handled."""
        gone, self._gone = self._gone, {}
        for link, changes in gone.values():
            self._note(link, changes)

    def _look_at_clocks(self) -> None:
        """Note a step of the wall clock."""
        now = self._clock()
        offset = time.time() - now  # read second: a pause between the two makes stamps older
        if abs(offset - self._offset) > STEP:
            self._stepped_at = now
        self._offset = offset

    def _arrivals(self, link: Link, times: Sequence[float], count: int) -> Sequence[float]:
        """Return when datagrams arrived: as the link says, or after it was last seen empty."""
        if link.name not in self._clients or link.name in self._timed:
            return times
        since = self._empty_at[link.name]
        if link.is_stream and self._clock() < self._settled_at:
            since = min(since, self._stalled_at)
            if count >= DRAIN:  # there is more
                self._settled_at = self._clock() + SETTLES
        if not times or since <= self._stepped_at:
            return [since] * count
        ahead = self._offset + STEP
        return [max(since, stamp - ahead) for stamp in times]

    def _received(self, link: Link, most: int) -> tuple[list[tuple[Peer, bytes]], Sequence[float]]:
        """Return what a link has, with the times that it tells."""
        if timed := self._timed.get(link.name):
            return timed.receive_timed(most)
        if stamped := self._stamped.get(link.name):
            return stamped.receive_stamped(most)
        stream = self._streams.get(link.name)
        if stream is None:
            return link.receive(most), ()
        while before := stream.take_changes():  # noting some may cause others
            self._note(stream, before)
        pieces = stream.receive(most)
        changes = stream.take_changes()
        self._note(stream, [change for change in changes if change.state is PeerState.UP])
        gone = [change for change in changes if change.state is not PeerState.UP]
        if gone:
            self._gone[link.name] = stream, gone
        return pieces, ()
