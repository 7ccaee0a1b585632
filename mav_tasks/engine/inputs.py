"""The engine's inputs and its output packets, as plain values."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from math import inf
from typing import NamedTuple

from mav_tasks.config.settings import Settings
from mav_tasks.mavlink.signing import Key
from mav_tasks.tasks.lifecycle import TaskState
from mav_tasks.tasks.restored import Restored

Peer = Hashable  # an endpoint on a link; only the link knows what it is
Place = tuple[str, Peer]  # link name, endpoint on it

FLEET_LINK = "fleet"  # on which the gateways of a fleet pass on each other's clients


class LinkSide(Enum):
    """What is on the other end of a link."""

    CLIENTS = auto()
    VEHICLES = auto()


@dataclass(frozen=True, slots=True)
class Packets:
    """Datagrams of one link, or pieces of its streams, in the order in which they arrived.

    ``arrived`` has the time at which each of them arrived on this machine; where nobody knows that,
    a time from which on it can have arrived. It is empty if each was read on arrival.
    """

    link: str
    datagrams: Sequence[tuple[Peer, bytes]]
    arrived: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class AtOnce:
    """Packets of several links that were read in one go, in the order of their arrival."""

    packets: tuple[Packets, ...]


@dataclass(frozen=True, slots=True)
class LinkChanged:
    """A link came up or went down.

    - ``peers``: endpoints known in advance; the server sends to them before it hears them.
    - ``is_local``: nothing outside this machine can be on the link.
    - ``is_stream``: data may be cut anywhere, and PeerChanged reports who is connected.
    - ``takes_unsigned``: the link accepts unsigned packets.
    - ``key``: name of the key that signs packets to a peer that has not signed yet. On a vehicle
      link it is the only valid key.
    - ``capacity``: bytes per second that the link carries, or None if that is unknown.
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
    """The complete list of signing keys changed; a revoked key has no secret."""

    keys: tuple[Key, ...]


@dataclass(frozen=True, slots=True)
class PeerChanged:
    """A peer of a stream link connected, and can be sent to at once, or it disconnected."""

    link: str
    peer: Peer
    up: bool


@dataclass(frozen=True, slots=True)
class Congestion:
    """A peer of a stream link does not accept everything that is sent, or accepts it again."""

    link: str
    peer: Peer
    is_congested: bool


@dataclass(frozen=True, slots=True)
class Committed:
    """All events up to and including this number are durable."""

    through: int


@dataclass(frozen=True, slots=True)
class HaltsKept:
    """All halts up to and including this event outlive a crash, whatever became of the rest."""

    through: int


@dataclass(frozen=True, slots=True)
class StoreFailed:
    """The store could not make events durable; it keeps trying."""

    text: str


@dataclass(frozen=True, slots=True)
class HaltNotStored:
    """The halt of a vehicle is not durable yet: a restart of the server would lose it."""

    vehicle: int
    text: str = ""


@dataclass(frozen=True, slots=True)
class LeaseChanged:
    """What the lease of this gateway permits from now on; sent after each renewal.

    ``move_until``: s, until when it may move its vehicles. ``stop_until``: until when it may send
    them what stops them; after that another gateway may have them.
    """

    move_until: float
    stop_until: float


@dataclass(frozen=True, slots=True)
class VehiclesTaken:
    """This gateway has these vehicles now; ``restored`` is what the store has about them."""

    vehicles: tuple[int, ...]
    restored: Restored


@dataclass(frozen=True, slots=True)
class VehiclesGone:
    """Another gateway hears these vehicles of ours: forget those that ``Engine.reach`` permits."""

    vehicles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FleetChanged:
    """Which vehicle the other gateways have: pairs of its system id and the gateway's name."""

    holders: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class TasksElsewhere:
    """How tasks stand by the fleet's store that ``Engine.expected`` names; None: no such task."""

    states: tuple[tuple[int, TaskState | None], ...]


@dataclass(frozen=True, slots=True)
class ParametersChanged:
    """All parameters that clients have set, at any gateway of the fleet: pairs of name, value."""

    values: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class IdsGranted:
    """The next ``count`` task ids from ``first`` on are this gateway's, besides earlier ones."""

    first: int
    count: int


@dataclass(frozen=True, slots=True)
class NonceTaken:
    """The store has refused a task of ours: the fleet had one with its nonce before.

    That is ``known``; its ``payload`` tells whether it is the same submission. This comes before
    the ``Committed`` of our task.
    """

    task_id: int
    known: int
    payload: str


@dataclass(frozen=True, slots=True)
class SettingsChanged:
    """New settings are in force."""

    settings: Settings


@dataclass(frozen=True, slots=True)
class WallClock:
    """UTC = monotonic time + ``offset`` seconds; sent at start and after each clock step."""

    offset: float


@dataclass(frozen=True, slots=True)
class Shutdown:
    """The server is to end: stop the vehicles that it drives."""


Input = (
    Packets
    | AtOnce
    | LinkChanged
    | KeysChanged
    | PeerChanged
    | Congestion
    | Committed
    | HaltsKept
    | StoreFailed
    | HaltNotStored
    | LeaseChanged
    | VehiclesTaken
    | VehiclesGone
    | FleetChanged
    | TasksElsewhere
    | ParametersChanged
    | IdsGranted
    | NonceTaken
    | SettingsChanged
    | WallClock
    | Shutdown
)


class Outgoing(NamedTuple):
    """One datagram to send; ``is_first`` puts it before everything that is queued.

    ``until``, in monotonic seconds, is the last time at which it may leave. Otherwise a process
    that got no CPU time would move a vehicle on outdated data.
    """

    link: str
    peer: Peer
    data: bytes
    is_first: bool = False
    until: float = inf
