"""What gateways say to each other in notifications: who is there, datagrams, and how old they are.

Pure: the caller has the database, the clock and the random numbers.

Each gateway that begins to listen chooses a session, a random number, and says HELLO to all. Others
answer with a MAIL for that session, and get one for theirs. A MAIL is authenticated together with
the session that it is for, so it was sent after that gateway began to listen; and the counter of a
sender's session must rise. So neither a stranger nor a recording can speak for a gateway. A HELLO
may be a recording: all that comes of it is one MAIL, for a session that nobody has.

How old a datagram is, nobody learns from clocks of two machines. Each packet has its sender's time
(``sent``). The receiver finds by how much its own clock is ahead, plus the trip of that packet, and
keeps the least of some seconds. With it, it tells in its own packets when they were packed, on the
other's clock, or earlier (``since``). The other one subtracts that from its time of reading. So a
datagram's age is overestimated by the fastest trip in the other direction, and never
underestimated: it includes what the sender, the database or the receiver stood still.

Packets that are first are kept until the other one says that it has taken them (``taken``). If a
session ends before that, they are sent again: they may arrive twice. Those that waited for a
connection leave when there is one, however long that took.
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import inf
from typing import Protocol

from mav_tasks.fleet.notification import (
    EACH,
    NOBODY,
    Datagram,
    Kind,
    Packet,
    Seal,
    room_for,
)
from mav_tasks.fleet.outbox import ALL, Waiting

BEAT = 0.2  # s; after this time without a packet for another gateway, an empty one is sent
HELLO = 1.0  # s from one HELLO to the next
SILENCE = 3.0  # s without a packet, after which a gateway cannot be reached any more
WINDOW = 5.0  # s; the least difference of clocks counts for one to two of them
#: packets for one gateway in one round trip: what is first then does not wait long for the next
AT_A_TIME = 4
#: s that clocks may run apart within two windows (NTP slews by 500 ppm at most), and more than that
APART = 0.05
_MOST = 64  # gateways that have said HELLO and are not known yet

_MICRO = 1e6


@dataclass(frozen=True, slots=True)
class Arrived:
    """A datagram of another gateway, which was read at ``at`` (boot_time of this machine).

    ``waited``: it was given to ``send`` so many seconds before ``at``, or less; inf: unknown.
    ``until``: it is of use until then, or less long (boot_time of this machine).
    ``session`` changes when the sender's process, or only its connection, has begun again.
    """

    sender: str
    session: bytes
    payload: bytes
    at: float
    waited: float
    first: bool = False
    until: float = inf


@dataclass(frozen=True, slots=True)
class Counts:
    """What has come of datagrams and notifications so far."""

    sent: int = 0  # datagrams, once for each gateway
    dropped: int = 0  # datagrams, because too many waited
    expired: int = 0  # datagrams, because they could not leave in time
    arrived: int = 0  # datagrams
    late: int = 0  # datagrams that came to the loop after ``until``; first ones are never late
    unread: int = 0  # datagrams that arrived while too many waited for the event loop
    lost: int = 0  # notifications of other gateways that did not arrive
    refused: int = 0  # notifications: forged, recorded, or for an earlier session of ours


class Source(Protocol):
    """Where the datagrams wait that are to be sent: ``Outbox``, or one that threads share."""

    def meet(self, names: frozenset[str], *, now: float) -> None:
        """Take which gateways can be reached now."""

    def renew(self, *, now: float) -> None:
        """A connection begins: what is first waited only because there was none."""

    def put_back(self, to: str, items: Iterable[Waiting]) -> None:
        """Put datagrams that are first back."""

    def take(self, to: str, room: int, *, each: int, now: float) -> list[Waiting]:
        """Remove and return what may leave now."""


class ClockOffset:
    """By how much our clock is ahead of another's, at the most."""

    def __init__(self) -> None:
        self._least = self._before = inf
        self._next_window = -inf

    def __repr__(self) -> str:
        return f"ClockOffset({self.seconds:.6f})"

    @property
    def seconds(self) -> float:
        """The difference plus the fastest trip of the last seconds; inf: unknown."""
        return min(self._least, self._before)

    def heard(self, stamp: float, at: float) -> None:
        """Take the other's time in a packet that was read at ``at``."""
        if at >= self._next_window:
            is_recent = at < self._next_window + WINDOW
            self._before = self._least if is_recent else inf
            self._least, self._next_window = inf, at + WINDOW
        self._least = min(self._least, at - stamp)


@dataclass(slots=True)
class _Peer:
    """Another gateway in one of its sessions."""

    session: bytes
    heard_at: float
    sent_at: float = -inf
    offset: ClockOffset = field(default_factory=ClockOffset)
    #: what was sent first and may have been lost, with the counter of its packet
    untaken: deque[tuple[int, Waiting]] = field(default_factory=deque)


class Exchange:
    """One gateway's part. ``begin`` comes first, and again for each new connection."""

    def __init__(self, name: str, outbox: Source) -> None:
        self._name = name
        self._outbox = outbox
        self._session = NOBODY
        self._counter = 0
        self._hello_at = 0.0
        self._peers: dict[str, _Peer] = {}
        self._greeting: dict[str, _Peer] = {}  # said HELLO: perhaps a recording
        self._taken: dict[bytes, int] = {}  # a sender's session -> its highest counter
        self._sent_to: dict[str, int] = {}  # a gateway -> packets for it
        self._had_of: dict[str, int] = {}  # a gateway -> the last one's number
        self.sent = self.arrived = self.late = self.lost = self.refused = 0

    def __repr__(self) -> str:
        return f"Exchange({self._name}, with {sorted(self._peers)})"

    @property
    def peers(self) -> frozenset[str]:
        """The gateways that can be reached, as far as is known."""
        return frozenset(self._peers)

    def begin(self, seal: Seal, session: bytes, *, now: float) -> None:
        """Begin to listen, as this random ``session``."""
        for name, peer in self._peers.items():
            self._put_back(name, peer)
        self._seal, self._session, self._counter = seal, session, 0
        self._hello_at = now
        self._peers.clear()
        self._greeting.clear()
        self._taken.clear()
        self._outbox.renew(now=now)
        self._outbox.meet(self.peers, now=now)

    def receive(self, text: str, *, now: float) -> list[Arrived]:
        """Take a notification that was read at ``now``; return its datagrams."""
        packet = self._seal.packet(text, self._session)
        if packet is None:
            self.refused += 1
            return []
        if packet.name == self._name:  # our own HELLO
            return []
        if packet.kind is Kind.HELLO:
            self._greet(packet, now)
            return []
        if packet.counter <= self._taken.get(packet.session, 0):
            self.refused += 1
            return []
        self._taken[packet.session] = packet.counter
        self._count(packet)
        peer = self._peer_of(packet, now)
        peer.heard_at = now
        peer.offset.heard(packet.sent / _MICRO, now)
        while peer.untaken and peer.untaken[0][0] <= packet.taken:
            peer.untaken.popleft()
        return list(self._datagrams(packet, now))

    def notifications(self, now: float) -> list[tuple[str, str]]:
        """Return what must be sent at ``now``, each a channel and a text."""
        for name, peer in tuple(self._peers.items()):
            if now > peer.heard_at + SILENCE:
                self._put_back(name, peer)
                del self._peers[name]
        self._outbox.meet(self.peers, now=now)
        found: list[tuple[str, str]] = []
        if now >= self._hello_at:
            self._hello_at = now + HELLO
            hello = Packet(Kind.HELLO, self._name, self._session, self._next(), sent=_stamp(now))
            found.append((self._seal.channel(ALL), self._seal.text(hello, NOBODY)))
        for name, peer in self._greeting.items():
            found.append((self._seal.channel(name), self._mail(peer, [], now, number=0)))
        self._greeting.clear()
        for name, peer in self._peers.items():
            texts = list(self._mails(name, peer, now))
            found += [(self._seal.channel(name), text) for text in texts]
        return found

    def next_deadline(self) -> float:
        """Return when ``notifications`` has something to send, if nothing is put or received."""
        if self._greeting:
            return -inf
        return min(self._hello_at, *(peer.sent_at + BEAT for peer in self._peers.values()), inf)

    def _mails(self, name: str, peer: _Peer, now: float) -> Iterator[str]:
        for _ in range(AT_A_TIME):
            items = self._outbox.take(name, room_for(self._name), each=EACH, now=now)
            if items or now >= peer.sent_at + BEAT:
                self._sent_to[name] = number = self._sent_to.get(name, 0) + 1
                yield self._mail(peer, items, now, number=number)
            if not items:
                return

    def _mail(self, peer: _Peer, items: list[Waiting], now: float, *, number: int) -> str:
        """Return a packet for a gateway."""
        counter = self._next()
        peer.sent_at = now
        peer.untaken += [(counter, each) for each in items if each.first]
        self.sent += len(items)
        packet = Packet(
            Kind.MAIL,
            self._name,
            self._session,
            counter,
            number,
            _stamp(now),
            _stamp(now - peer.offset.seconds),
            self._taken.get(peer.session, 0),
            [Datagram(each.payload, now - each.at, each.until - now, each.first) for each in items],
        )
        return self._seal.text(packet, peer.session)

    def _greet(self, hello: Packet, now: float) -> None:
        """Answer a HELLO of a session that is not known yet."""
        known = self._peers.get(hello.name)
        if known is not None and known.session == hello.session:
            return
        if len(self._greeting) < _MOST:
            peer = self._greeting[hello.name] = _Peer(hello.session, now)
            peer.offset.heard(hello.sent / _MICRO, now)

    def _peer_of(self, packet: Packet, now: float) -> _Peer:
        """Return the sender of a MAIL, which is in this session now."""
        peer = self._peers.get(packet.name)
        if peer is None or peer.session != packet.session:
            if peer is not None:
                self._put_back(packet.name, peer)
            peer = self._peers[packet.name] = _Peer(packet.session, now)
            self._outbox.meet(self.peers, now=now)
        return peer

    def _put_back(self, name: str, peer: _Peer) -> None:
        """Send again what was first and has perhaps not arrived."""
        self._outbox.put_back(name, [item for _, item in peer.untaken])
        peer.untaken.clear()

    def _count(self, packet: Packet) -> None:
        """Count the packets that are missing; a new process begins with 1."""
        if packet.number:
            had = self._had_of.get(packet.name)
            if had is not None and packet.number > had:
                self.lost += packet.number - had - 1
            self._had_of[packet.name] = packet.number

    def _datagrams(self, packet: Packet, now: float) -> Iterator[Arrived]:
        """Return the datagrams of a packet that are still of use; a STOP always is."""
        under_way = now - packet.since / _MICRO if packet.since else inf
        if under_way < -APART:  # this machine was suspended, and its clock with it
            under_way = inf
        under_way = max(0.0, under_way)
        for each in packet.datagrams:
            if under_way > each.left and not each.first:
                self.late += 1
            else:
                self.arrived += 1
                yield Arrived(
                    packet.name,
                    packet.session,
                    each.payload,
                    now,
                    under_way + each.age,
                    each.first,
                    now + each.left - under_way if under_way < inf else inf,
                )

    def _next(self) -> int:
        self._counter += 1
        return self._counter


def _stamp(seconds: float) -> int:
    """Return microseconds for a packet; 0 for what is not known."""
    return max(0, int(seconds * _MICRO)) if seconds > -inf else 0
