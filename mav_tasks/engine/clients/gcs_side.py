"""The client links and the clients on them, by link and endpoint.

Any bytes may come in here; only a packet with a good CRC makes its sender a client. ``receive``
returns a client's packet as a value; the engine acts on it.
"""

from collections.abc import Callable, Collection
from math import inf
from typing import NamedTuple

from mav_tasks.engine.clients.gcs_client import NO_STANDING, GcsClient
from mav_tasks.engine.clients.rights import RightsBook
from mav_tasks.engine.clients.signatures import UNSIGNED, Signatures
from mav_tasks.engine.inputs import Congestion, LinkChanged, Outgoing, Peer, PeerChanged, Place
from mav_tasks.engine.packet_sender import PacketSender
from mav_tasks.engine.timers import Timer
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer, target_of
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.signing import Key
from mav_tasks.services.command_receiver import is_stop
from mav_tasks.services.token_bucket import TokenBucket
from mav_tasks.settings import Settings

MAX_LINK_NUMBER = 255  # limit of its field in TASK_STATUS
NEWCOMERS = 2.0  # new unsigned clients a second, on average; the burst is ``max_clients``
CROWDED = 2  # beyond ``max_clients`` / CROWDED, clients heard only once are forgotten after SILENT
GONE = 10.0  # s of silence, after which a client of any standing may replace this one
SILENT = 3.0  # s, after which a new client may replace this one; heartbeats come each second


class Received(NamedTuple):
    """A packet of a client. ``message`` is None if its id is not in the dialect.

    ``arrived``: when it arrived on this machine, s, as ``Packets`` tells.
    """

    client: GcsClient
    packet: Packet
    message: m.Message | None
    key: Key
    arrived: float


class GcsSide:
    """The clients by link and endpoint."""

    def __init__(
        self,
        *,
        queue: list[Outgoing],
        packer: Packer,
        signatures: Signatures,
        statuses: Timer,
        settings: Settings,
    ) -> None:
        """``statuses`` fires when a TASK_STATUS to a client is due."""
        self._queue = queue
        self._packer = packer
        self._signatures = signatures
        self._settings = settings
        self._rights = RightsBook(settings.roles)
        self._decoder = Decoder()
        #: the client links, by name
        self.links: set[str] = set()
        self._newcomers: TokenBucket | None = None
        #: number of each client link of this run, from 1
        self.link_numbers: dict[str, int] = {}
        self._clients: dict[Place, GcsClient] = {}
        #: all clients
        self.clients = self._clients.values()
        #: return a client by its key, None if it is gone
        self.client = self._clients.get
        #: counts of what came in on these links
        self.counts = self._decoder.counts
        self._statuses = statuses

    def plan_statuses(self) -> None:
        """Set the timer to the next TASK_STATUS that is due."""
        due = [client.statuses.next_deadline() for client in self.clients]
        self._statuses.set(min(due, default=inf))

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Add a link that came up, remove one that went down."""
        if not change.up:
            self.links.discard(change.link)
            for key in [key for key in self._clients if key[0] == change.link]:
                self._remove(key)
            return
        self.links.add(change.link)
        self.link_numbers.setdefault(change.link, min(len(self.link_numbers) + 1, MAX_LINK_NUMBER))
        for peer in change.peers:
            self._add(change.link, peer, now=now)

    def change_peer(self, change: PeerChanged, *, now: float) -> None:
        """Add a connection of a stream link, or remove it when it is closed."""
        self._remove((change.link, change.peer))
        self._signatures.forget(change.link, change.peer)
        if change.up and change.link in self.links:
            self._add(change.link, change.peer, is_connected=True, now=now)

    def note_congestion(self, change: Congestion, *, now: float) -> None:
        """Hold back telemetry to an endpoint that is congested."""
        if client := self._clients.get((change.link, change.peer)):
            client.thinner.backoff.note(change.is_congested, now=now)

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self._rights = RightsBook(settings.roles)
        self._newcomers = None
        for client in self.clients:
            client.apply(settings.clients)
            client.take_rights(self._rights.of(client.signed_by, client.who), now=client.heard_at)

    def forget_unknown(self) -> list[Place]:
        """Forget clients whose key is no longer valid; configured ones become unheard.

        Return their links and endpoints.
        """
        unknown = [
            (key, client)
            for key, client in self._clients.items()
            if not self._signatures.knows(client.signed_by)
        ]
        for key, client in unknown:
            self._drop(key, client)
        return [key for key, _ in unknown]

    def has(self, link: str, peer: Peer) -> bool:
        """Whether a client is at this endpoint."""
        return (link, peer) in self._clients

    def receive(
        self, link: str, peer: Peer, packet: Packet, *, arrived: float, now: float
    ) -> Received | None:
        """Return a client's packet, decoded; None if it is to be ignored."""
        message = None
        if packet.message_id in m.ALL:
            message = self._decoder.decode(packet)
            if message is None:
                return None
        else:
            self.counts.unknown += 1
        key = self._signatures.admit(link, peer, packet)
        if key is None:
            return None
        client = self._clients.get((link, peer))
        if client is None:
            if message is None:  # bytes without a checked CRC make no client
                return None
            client = self._admit(link, peer, packet, message, key=key, now=now)
            if client is None:
                return None
        client.arrived, client.waited = arrived, now - arrived
        if packet.source != client.source or key is not client.signed_by:
            self._know(client, packet.source, key, now=now)
        if message is not None:
            client.heard(packet, now=now)
        return Received(client, packet, message, key, arrived)

    def hear_out(self, received: Received, *, now: float) -> None:
        """Restore a client's address, key and rights of this packet, one of several in a batch."""
        client = received.client
        client.arrived, client.waited = received.arrived, now - received.arrived
        self._know(client, received.packet.source, received.key, now=now)

    def _know(self, client: GcsClient, source: Address, key: Key, *, now: float) -> None:
        """Set the address and key of a client's packet in hand, and the rights that follow."""
        client.source, client.signed_by = source, key
        client.who = client.submitter(source)
        client.take_rights(self._rights.of(key, client.who), now=now)

    def forward(self, packet: Packet, *, now: float) -> None:
        """Forward a vehicle's packet to every client that is to have it.

        A packet with a target goes only to the clients there: a client takes an answer to
        another's question for its own.
        """
        if packet.message_id not in m.TARGETED:
            for client in self.clients:
                client.forward(packet, now=now)
            return
        message = self._decoder.decode(packet)
        if message is None:
            return
        target = target_of(message)
        for client in self.clients:
            if client.is_reached_by(target):
                client.forward(packet, now=now)
            else:
                client.outlet.withhold(packet.source)

    def continue_numbers(self, packet: Packet) -> None:
        """Continue the sequence numbers of this packet's source, to every client."""
        for client in self.clients:
            client.outlet.continue_numbers(packet)

    def forget_vehicle(self, system_id: int, tasks: Collection[int]) -> None:
        """Forget a vehicle with its ``tasks``, for every client."""
        for client in self.clients:
            client.forget(system_id, tasks)
        self.plan_statuses()

    def tell(self, text: str, severity: MavSeverity, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT to every client."""
        for client in self.clients:
            client.tell(text, severity, source, now=now)

    def forget_silent(self, *, awaits: Callable[[GcsClient], bool], now: float) -> None:
        """Drop clients that have been silent for long; configured ones become unheard again.

        ``awaits``: whether a client waits for the end of a task; it is kept, however long it takes.
        """
        limits = self._settings.clients
        clients = list(self._clients.items())
        for key, client in clients:
            silence = now - client.heard_at
            if client.is_configured and not client.is_connected:
                if silence > limits.push_lost:
                    client.is_heard = False
                continue
            is_passing = client.is_passing and not client.is_connected
            passes = is_passing and self._is_crowd(len(clients))
            if silence > (SILENT if passes else limits.forget_after) and not awaits(client):
                self._drop(key, client)

    def _drop(self, key: Place, client: GcsClient) -> None:
        if client.is_configured:
            client.is_heard = False
        else:
            self._remove(key)
            self._signatures.forget(*key)

    def _remove(self, key: Place) -> None:
        client = self._clients.pop(key, None)
        if client is not None and client.statuses.next_deadline() < inf:
            self.plan_statuses()

    def _add(self, link: str, peer: Peer, *, now: float, is_connected: bool = False) -> None:
        """Add a configured or connected client, even if there is no room for it."""
        self._has_room(NO_STANDING, now=now)
        self._clients[link, peer] = self._new(
            link, peer, is_configured=True, is_connected=is_connected, now=now
        )

    def _new(
        self, link: str, peer: Peer, *, is_configured: bool, is_connected: bool, now: float
    ) -> GcsClient:
        return GcsClient(
            PacketSender(link, peer, self._queue, self._packer, self._signatures),
            settings=self._settings.clients,
            wake=self._statuses.bring_forward,
            is_configured=is_configured,
            is_connected=is_connected,
            now=now,
        )

    def _admit(
        self, link: str, peer: Peer, packet: Packet, message: m.Message, *, key: Key, now: float
    ) -> GcsClient | None:
        """Add a client and return it, or None if too many are active. A STOP needs no room.

        Otherwise a sender that keeps changing its endpoint would displace all clients, and have
        telemetry sent to all its endpoints. Who may do more comes first, and of those who may do
        the same the signed ones: anybody can pose as many unsigned ones.
        """
        if self._newcomers is None:
            most = float(self._settings.clients.max_clients)
            self._newcomers = TokenBucket(rate=NEWCOMERS, burst=most, now=now)
        client = self._new(link, peer, is_configured=False, is_connected=False, now=now)
        self._know(client, packet.source, key, now=now)
        is_signed = key is not UNSIGNED
        may_come = is_signed or self._newcomers.take(now=now)
        if may_come and self._has_room(client.standing, now=now):
            client.is_one_of_many = self._is_crowd(len(self._clients)) and not is_signed
            self._clients[link, peer] = client
            return client
        return client if is_stop(message) else None

    def _is_crowd(self, clients: int) -> bool:
        return clients > self._settings.clients.max_clients // CROWDED

    def _has_room(self, standing: tuple[int, bool], *, now: float) -> bool:
        """Whether there is room for a client of this standing; perhaps forget one in its place.

        That one has a lower standing, or the same and is silent, or has been silent for long.
        Silent ones go first: commands that have ended leave clients of any standing behind.
        """
        if len(self._clients) < self._settings.clients.max_clients:
            return True
        others = [
            client
            for client in self.clients
            if not client.is_configured
            and (
                (client.standing, now - client.heard_at < SILENT) < (standing, True)
                or now - client.heard_at >= GONE
            )
        ]
        last = min(
            others,
            key=lambda each: (now - each.heard_at < SILENT, each.standing, each.heard_at),
            default=None,
        )
        if last is None:
            return False
        self._drop(last.key, last)
        return True
