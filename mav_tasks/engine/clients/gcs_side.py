"""All clients and the links to them: who is there, what they are shown and told.

Any bytes may come in here; only a packet with a good CRC makes its sender a client. What a client
wants is given back as a value; the engine sees to it.
"""

from collections.abc import Callable
from math import inf
from typing import NamedTuple

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.rights import RightsBook
from mav_tasks.engine.clients.signatures import UNSIGNED, Signatures
from mav_tasks.engine.inputs import Congestion, LinkChanged, Outgoing, Peer, PeerChanged
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

MAX_LINK_NUMBER = 255  # of its field in TASK_STATUS
NEWCOMERS = 2.0  # a second in the long run, as many at once as there may be
CROWDED = 2  # this part of all places being taken, who was heard once only is not waited for
SILENT = 3.0  # s, after which a client may be forgotten for another; heartbeats come each second


class Received(NamedTuple):
    """A packet of a client. ``message`` is None when its id is not in the dialect.

    ``waited``: for so many seconds it may have lain here before it was read.
    """

    client: GcsClient
    packet: Packet
    message: m.Message | None
    key: Key
    waited: float


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
        """``statuses`` comes when a client is to be told of a task."""
        self._queue = queue
        self._packer = packer
        self._signatures = signatures
        self._settings = settings
        self._rights = RightsBook(settings.roles)
        self._decoder = Decoder()
        #: the client links, by name
        self.links: set[str] = set()
        self._newcomers: TokenBucket | None = None
        #: packets of strangers for whom there was no room
        self.turned_away = 0
        #: of the client links that have been there in this run, from 1
        self.link_numbers: dict[str, int] = {}
        self._clients: dict[tuple[str, Peer], GcsClient] = {}
        #: all that are there
        self.clients = self._clients.values()
        #: gives a client by its key, if it is still there
        self.client = self._clients.get
        #: what came in on these links
        self.counts = self._decoder.counts
        self._statuses = statuses

    def plan_statuses(self) -> None:
        """Have the statuses that are to be told next come when they are due."""
        due = [client.statuses.next_deadline() for client in self.clients]
        self._statuses.set(min(due, default=inf))

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Take a link into use, or out of it."""
        if not change.up:
            self.links.discard(change.link)
            for key in [key for key in self._clients if key[0] == change.link]:
                self._remove(key)
            return
        self.links.add(change.link)
        number = min(len(self.link_numbers) + 1, MAX_LINK_NUMBER)
        self.link_numbers.setdefault(change.link, number)
        for peer in change.peers:
            self._add(change.link, peer, is_configured=True, now=now)

    def change_peer(self, change: PeerChanged, *, now: float) -> None:
        """Speak to who has come, forget who is gone."""
        self._remove((change.link, change.peer))
        self._signatures.forget(change.link, change.peer)
        if change.up and change.link in self.links:
            self._add(change.link, change.peer, is_configured=True, is_connected=True, now=now)

    def note_congestion(self, change: Congestion, *, now: float) -> None:
        """Keep telemetry from a way out that does not take it."""
        client = self._clients.get((change.link, change.peer))
        if client is not None:
            client.thinner.backoff.note(change.is_congested, now=now)

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self._rights = RightsBook(settings.roles)
        self._newcomers = None
        for client in self.clients:
            client.apply(settings.clients)
            rights = self._rights.of(client.signed_by, client.who)
            client.take_rights(rights, now=client.heard_at)

    def forget_unknown(self) -> list[tuple[str, Peer]]:
        """Forget who has signed with a key that counts no more; who is spoken to is unheard.

        Gives where they were.
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
        """Whether an endpoint is a client's."""
        return (link, peer) in self._clients

    def receive(
        self, link: str, peer: Peer, packet: Packet, *, waited: float = 0.0, now: float
    ) -> Received | None:
        """Take a packet in; None if it means nothing."""
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
            if message is None:  # unverified bytes make nobody a client
                return None
            is_signed = key is not UNSIGNED
            client = self._admit(link, peer, message, is_signed=is_signed, now=now)
            if client is None:
                return None
        client.waited = waited
        if packet.source != client.source or key is not client.signed_by:
            self._know(client, packet.source, key, now=now)
        if message is not None:
            client.heard(packet, now=now)
        return Received(client, packet, message, key, waited)

    def hear_out(self, received: Received, *, now: float) -> None:
        """Have a client be again who it was when it sent this packet, of several at one moment."""
        received.client.waited = received.waited
        self._know(received.client, received.packet.source, received.key, now=now)

    def _know(self, client: GcsClient, source: Address, key: Key, *, now: float) -> None:
        """Let it count for a client who sends from this address of its, and signs with this key."""
        client.source, client.signed_by = source, key
        client.who = client.submitter(source)
        client.take_rights(self._rights.of(key, client.who), now=now)

    def forward(self, packet: Packet, *, now: float) -> None:
        """Show a vehicle's packet to every client that is to have it.

        One that names whom it is for goes to nobody else: clients take an answer to another's
        question for their own.
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
        """Let this packet follow on the last one of its source towards every client."""
        for client in self.clients:
            client.outlet.continue_numbers(packet)

    def tell(self, text: str, severity: MavSeverity, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT to every client."""
        for client in self.clients:
            client.tell(text, severity, source, now=now)

    def forget_silent(self, *, awaits: Callable[[GcsClient], bool], now: float) -> None:
        """Drop clients that have been silent for long; configured ones become unheard again.

        Who awaits the end of a task is told of it, however long it takes.
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

    def _drop(self, key: tuple[str, Peer], client: GcsClient) -> None:
        if client.is_configured:
            client.is_heard = False
        else:
            self._remove(key)
            self._signatures.forget(*key)

    def _remove(self, key: tuple[str, Peer]) -> None:
        client = self._clients.pop(key, None)
        if client is not None and client.statuses.next_deadline() < inf:
            self.plan_statuses()

    def _add(
        self, link: str, peer: Peer, *, is_configured: bool, now: float, is_connected: bool = False
    ) -> GcsClient:
        self._has_room(now=now)  # who is configured, or has dialled, always has
        client = self._new(
            link, peer, is_configured=is_configured, is_connected=is_connected, now=now
        )
        self._clients[link, peer] = client
        return client

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
        self, link: str, peer: Peer, message: m.Message, *, is_signed: bool, now: float
    ) -> GcsClient | None:
        """Make somebody a client, unless there are many who are not silent; STOP alone needs none.

        Or else whoever sends from ever other places would drive everybody out, and have telemetry
        sent to all those places. Who signs comes before who does not: anybody can be many of those.
        """
        if self._newcomers is None:
            most = float(self._settings.clients.max_clients)
            self._newcomers = TokenBucket(rate=NEWCOMERS, burst=most, now=now)
        may_come = is_signed or self._newcomers.take(now=now)
        if may_come and self._has_room(is_signed=is_signed, now=now):
            is_one_of_many = self._is_crowd(len(self._clients)) and not is_signed
            client = self._add(link, peer, is_configured=False, now=now)
            client.is_one_of_many = is_one_of_many
            return client
        if is_stop(message):
            return self._new(link, peer, is_configured=False, is_connected=False, now=now)
        self.turned_away += 1
        return None

    def _is_crowd(self, clients: int) -> bool:
        return clients > self._settings.clients.max_clients // CROWDED

    def _has_room(self, *, is_signed: bool = False, now: float) -> bool:
        """Whether one more may be remembered; forgets who has been silent the longest for that."""
        if len(self._clients) < self._settings.clients.max_clients:
            return True
        others = [
            client
            for client in self.clients
            if not client.is_configured
            and (now - client.heard_at >= SILENT or (is_signed and client.signed_by is UNSIGNED))
        ]
        silent = min(others, key=lambda client: client.heard_at, default=None)
        if silent is None:
            return False
        self._drop(silent.key, silent)
        return True
