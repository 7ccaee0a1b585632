"""What can come into the engine, and what goes out of it: values, nothing else."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from math import inf
from typing import NamedTuple

from mav_tasks.mavlink.signing import Key
from mav_tasks.settings import Settings

Peer = Hashable  # an endpoint on a link; what it is only the link knows


class LinkSide(Enum):
    """Who is on the other end of a link."""

    CLIENTS = auto()
    VEHICLES = auto()


@dataclass(frozen=True, slots=True)
class Packets:
    """Datagrams of one link, or pieces of its streams, in the order in which they came.

    ``waited`` says of each for how long, in seconds, it lay on this machine before it was read, or
    may have; empty: it was read as soon as it came.
    """

    link: str
    datagrams: Sequence[tuple[Peer, bytes]]
    waited: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class AtOnce:
    """What was read of several links in one go: which of it came first nobody knows."""

    packets: tuple[Packets, ...]


@dataclass(frozen=True, slots=True)
class Backlog:
    """All that came on all links while the server stood still, clients' links first.

    How late each piece is ``waited`` says: what came only just now is among it.
    """

    packets: tuple[Packets, ...]


@dataclass(frozen=True, slots=True)
class LinkChanged:
    """A link came up or went down.

    ``peers`` are endpoints known beforehand: spoken to before they have been heard.
    ``is_local``: nobody beyond this machine can be on it. ``is_stream``: what it gives may be cut
    anywhere, and it tells by PeerChanged who is there. ``takes_unsigned``: so is what nobody has
    signed; ``key`` is the name of the key that signs what goes to whoever has not signed yet, and
    on a vehicle link the only one that counts. ``capacity``: bytes a second that it carries, None
    where that is not known.
    """

    link: str
    side: LinkSide
    up: bool
    peers: tuple[Peer, ...] = ()
    is_local: bool = True
    is_stream: bool = False
    takes_unsigned: bool = True
    key: str = ""
    capacity: float | None = None


@dataclass(frozen=True, slots=True)
class KeysChanged:
    """The keys with which packets may be signed are these now; revoked ones have no secret."""

    keys: tuple[Key, ...]


@dataclass(frozen=True, slots=True)
class PeerChanged:
    """Somebody is on a stream link now, and may be spoken to at once; or is there no more."""

    link: str
    peer: Peer
    up: bool


@dataclass(frozen=True, slots=True)
class Congestion:
    """The way out to a peer of a stream link does not take all that is sent, or does again."""

    link: str
    peer: Peer
    is_congested: bool


@dataclass(frozen=True, slots=True)
class Committed:
    """All events up to and with this number are durable."""

    through: int


@dataclass(frozen=True, slots=True)
class StoreFailed:
    """The store could not make events durable; it goes on trying."""

    text: str


@dataclass(frozen=True, slots=True)
class HaltNotStored:
    """What makes a vehicle stand is stored nowhere so far: a restart would lose it."""

    vehicle: int


@dataclass(frozen=True, slots=True)
class SettingsChanged:
    """New settings are in force."""

    settings: Settings


@dataclass(frozen=True, slots=True)
class WallClock:
    """UTC = monotonic time + ``offset`` seconds; sent at start and at each step of the clock."""

    offset: float


@dataclass(frozen=True, slots=True)
class Shutdown:
    """The server is to end: stop what it drives."""


Input = (
    Packets
    | AtOnce
    | Backlog
    | LinkChanged
    | KeysChanged
    | PeerChanged
    | Congestion
    | Committed
    | StoreFailed
    | HaltNotStored
    | SettingsChanged
    | WallClock
    | Shutdown
)


class Outgoing(NamedTuple):
    """One datagram to send; ``is_first``: before everything that waits for its turn.

    What has not left ``until`` then, monotonic seconds, must not leave any more: a process that was
    not given time would move a vehicle by what it knew long ago.
    """

    link: str
    peer: Peer
    data: bytes
    is_first: bool = False
    until: float = inf
