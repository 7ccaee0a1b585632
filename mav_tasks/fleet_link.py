"""The link between the gateways of a fleet: packets of and for each other's clients, by Carrier.

Each datagram is a byte that says whether it goes to a gateway or comes back from one, the number of
the client at the gateway to which that one is connected, and the packet.
"""

import logging
import struct

from mav_tasks.engine.clients.elsewhere import BACK, TOWARDS
from mav_tasks.engine.inputs import FLEET_LINK
from mav_tasks.fleet_io.carrier import Carrier
from mav_tasks.fleet_io.keeper import Trouble
from mav_tasks.links.base import Peer

log = logging.getLogger("mav_tasks")

_HEAD = struct.Struct(">cI")
_TO, _BACK = b">", b"<"


class FleetLink:
    """Implements ``StampedLink``; see ``engine/clients/elsewhere.py`` for its peers."""

    name = FLEET_LINK
    peers: tuple[Peer, ...] = ()
    is_local = True  # the database's: who writes there may do more than that
    is_stream = False
    note = ""

    def __init__(self, carrier: Carrier) -> None:
        self._carrier = carrier
        fd = carrier.fileno()
        assert fd is not None, "it is open"
        self._fd = fd

    def __repr__(self) -> str:
        return f"FleetLink({self._carrier!r})"

    def fileno(self) -> int:
        """Return the descriptor that is readable while something has arrived."""
        return self._fd

    def receive(self, limit: int) -> list[tuple[Peer, bytes]]:
        """Return up to ``limit`` datagrams, with their senders."""
        datagrams, _ = self.receive_stamped(limit, longest=0.0)
        return datagrams

    def receive_stamped(
        self, limit: int, *, longest: float
    ) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return datagrams as ``receive`` does, and the most that each was under way, s."""
        del longest  # the carrier measures, stalls of this process included
        found: list[tuple[Peer, bytes]] = []
        waited: list[float] = []
        for each in self._carrier.take(limit):
            if isinstance(each, Trouble):
                if each.words is not None:
                    log.warning("other gateways cannot be reached: %s", each.words)
                continue
            if len(each.payload) < _HEAD.size:
                continue
            kind, number = _HEAD.unpack_from(each.payload)
            data = each.payload[_HEAD.size :]
            if kind in (_TO, _BACK):
                way = (BACK,) if kind == _BACK else ()
                found.append(((*way, each.sender, number), data))
                waited.append(each.waited)
        return found, waited

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send a packet on its way to another gateway, or back to one; never block."""
        if not isinstance(peer, tuple):
            return
        *way, gateway, number = peer
        kind = _TO if way == [TOWARDS] else _BACK
        self._carrier.send(gateway, _HEAD.pack(kind, number) + data, first=first)

    def close(self) -> None:
        """Do nothing: the carrier is closed after the store."""
