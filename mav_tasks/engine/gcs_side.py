"""All clients and the links to them: who is there, what they are shown and told.

Any bytes may come in here; only a packet with a good CRC makes its sender a client. What a client
wants is given back as a value; the engine sees to it.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from mav_tasks.engine.gcs_client import GcsClient
from mav_tasks.engine.inputs import Congestion, LinkChanged, Outgoing, Peer, PeerChanged
from mav_tasks.engine.outlet import Outlet
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import DecodeCounts, Decoder, Packer, target_of
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.heartbeat import HeartbeatSender
from mav_tasks.settings import Settings

MAX_LINK_NUMBER = 255  # of its field in TASK_STATUS


class Received(NamedTuple):
    """A packet of a client. ``message`` is None when its id is not in the dialect."""

    client: GcsClient
    packet: Packet
    message: m.Message | None


class GcsSide:
    """The clients by link and endpoint."""

    def __init__(
        self, *, queue: list[Outgoing], packer: Packer, settings: Settings, now: float
    ) -> None:
        self._queue = queue
        self._packer = packer
        self._settings = settings
        self._decoder = Decoder()
        self._links: set[str] = set()
        self._link_numbers: dict[str, int] = {}  # from 1, in the order in which links came
        self._clients: dict[tuple[str, Peer], GcsClient] = {}
        self.heartbeat = HeartbeatSender(now=now)

    def __iter__(self) -> Iterator[GcsClient]:
        return iter(self._clients.values())

    @property
    def counts(self) -> DecodeCounts:
        """What came in on these links."""
        return self._decoder.counts

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Take a link into use, or out of it."""
        if not change.up:
            self._links.discard(change.link)
            for key in [key for key in self._clients if key[0] == change.link]:
                del self._clients[key]
            return
        self._links.add(change.link)
        self._link_numbers.setdefault(change.link, len(self._link_numbers) + 1)
        for peer in change.peers:
            self._add(change.link, peer, is_configured=True, now=now)

    def change_peer(self, change: PeerChanged, *, now: float) -> None:
        """Speak to who has come, forget who is gone."""
        self._clients.pop((change.link, change.peer), None)
        if change.up and change.link in self._links:
            self._add(change.link, change.peer, is_configured=True, is_connected=True, now=now)

    def note_congestion(self, change: Congestion, *, now: float) -> None:
        """Keep telemetry from a way out that does not take it."""
        client = self._clients.get((change.link, change.peer))
        if client is not None:
            client.thinner.stretch.note(change.is_congested, now=now)

    def link_number(self, link: str) -> int:
        """Give a client link's number, from 1; 0 for one that is not there in this run."""
        return min(self._link_numbers.get(link, 0), MAX_LINK_NUMBER)

    def owns(self, link: str) -> bool:
        """Whether a link of this name is a client link."""
        return link in self._links

    def apply(self, settings: Settings) -> None:
        """Take new settings, for clients to come."""
        self._settings = settings

    def client(self, key: tuple[str, Peer]) -> GcsClient | None:
        """Give a client by its key, if it is still there."""
        return self._clients.get(key)

    def receive(self, link: str, peer: Peer, packet: Packet, *, now: float) -> Received | None:
        """Take a packet in; None if it means nothing."""
        message = None
        if packet.message_id in m.ALL:
            message = self._decoder.decode(packet)
            if message is None:
                return None
        else:
            self.counts.unknown += 1
        client = self._clients.get((link, peer))
        if client is None:
            if message is None:  # unverified bytes make nobody a client
                return None
            client = self._add(link, peer, is_configured=False, now=now)
        if message is not None:
            client.heard(packet.source, now=now)
        return Received(client, packet, message)

    def forward(self, packet: Packet, *, now: float) -> None:
        """Show a vehicle's packet to every client that is to have it.

        One that names whom it is for goes to nobody else: clients take an answer to another's
        question for their own.
        """
        if packet.message_id not in m.TARGETED:
            for client in self._clients.values():
                client.forward(packet, now=now)
            return
        message = self._decoder.decode(packet)
        if message is None:
            return
        target = target_of(message)
        for client in self._clients.values():
            if client.is_reached_by(target):
                client.forward(packet, now=now)
            else:
                client.outlet.withhold(packet.source)

    def tell(self, text: str, severity: MavSeverity, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT to every client."""
        for client in self._clients.values():
            client.tell(text, severity, source, now=now)

    def forget_silent(self, *, awaits: Callable[[GcsClient], bool], now: float) -> None:
        """Drop clients that have been silent for long; configured ones become unheard again.

        Who awaits the end of a task is told of it, however long it takes.
        """
        limits = self._settings.clients
        for key, client in list(self._clients.items()):
            silence = now - client.heard_at
            if client.is_configured and not client.is_connected:
                if silence > limits.push_lost:
                    client.is_heard = False
            elif silence > limits.forget_after and not awaits(client):
                if client.is_configured:
                    client.is_heard = False
                else:
                    del self._clients[key]

    def _add(
        self, link: str, peer: Peer, *, is_configured: bool, now: float, is_connected: bool = False
    ) -> GcsClient:
        self._make_room()
        client = GcsClient(
            Outlet(link, peer, self._queue, self._packer),
            settings=self._settings.clients,
            is_configured=is_configured,
            is_connected=is_connected,
            now=now,
        )
        self._clients[link, peer] = client
        return client

    def _make_room(self) -> None:
        """Bound what unknown endpoints can make us remember."""
        if len(self._clients) >= self._settings.clients.max_clients:
            others = [c for c in self._clients.values() if not c.is_configured]
            if others:
                longest_silent = min(others, key=lambda client: client.heard_at)
                del self._clients[longest_silent.key]
