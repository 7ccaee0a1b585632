"""The link between the gateways of a fleet: packets of and for each other's clients, by Carrier.

Each datagram is a byte that says whether it goes to a gateway or comes back from one, the number of
the client at the gateway to which that one is connected, the seconds that the packet had waited at
that gateway, and the packet.
"""

import logging
import struct

from mav_tasks.basics.clock import boot_time
from mav_tasks.engine.clients.elsewhere import ARRIVED, BACK, TOWARDS
from mav_tasks.engine.inputs import FLEET_LINK
from mav_tasks.fleet.io.carrier import Carrier
from mav_tasks.fleet.io.keeper import Trouble
from mav_tasks.links.base import Peer

log = logging.getLogger("mav_tasks")

_HEAD = struct.Struct(">cId")
_TO, _BACK = b">", b"<"


class FleetLink:
    """See ``engine/clients/elsewhere.py`` for its peers."""

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
        return self.receive_timed(limit)[0]

    def receive_timed(self, limit: int) -> tuple[list[tuple[Peer, bytes]], list[float]]:
        """Return datagrams as ``receive`` does, and the earliest time at which each can have
        arrived at the first gateway, by this machine's ``boot_time``."""
        found: list[tuple[Peer, bytes]] = []
        arrived: list[float] = []
        for each in self._carrier.take(limit):
            if isinstance(each, Trouble):
                if each.words is not None:
                    log.warning("other gateways cannot be reached: %s", each.words)
                continue
            if len(each.payload) < _HEAD.size:
                continue
            kind, number, waited = _HEAD.unpack_from(each.payload)
            data = each.payload[_HEAD.size :]
            if kind in (_TO, _BACK):
                way = (BACK,) if kind == _BACK else ()
                found.append(((*way, each.sender, number), data))
                arrived.append(each.at - each.waited - waited)
        return found, arrived

    def send(self, peer: Peer, data: bytes, *, first: bool = False) -> None:
        """Send a packet on its way to another gateway, or back to one; never block."""
        assert isinstance(peer, tuple), "as this link and the engine make it"
        *way, gateway, number = peer
        kind, waited = _BACK, 0.0
        if way == [TOWARDS]:
            kind, waited = _TO, boot_time() - ARRIVED.unpack_from(data)[0]
            data = data[ARRIVED.size :]
        self._carrier.send(gateway, _HEAD.pack(kind, number, waited) + data, first=first)

    def close(self) -> None:
        """Do nothing: the carrier is closed after the store."""
