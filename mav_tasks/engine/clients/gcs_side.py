"""The client links and the clients on them, by link and endpoint.

Any bytes may come in here; only a packet with a good CRC makes its sender a client. ``let_in``
limits the datagrams that are parsed: a rate for each client, one for all strangers together. It
decides by sender and size alone, before parsing, which costs more. ``receive`` returns a client's
packet as a value; the engine acts on it.
"""

import re
from collections.abc import Callable, Collection
from itertools import islice, repeat
from operator import itemgetter
from typing import NamedTuple

from mav_tasks.config.settings import Settings
from mav_tasks.engine.clients.gcs_client import NO_STANDING, GcsClient
from mav_tasks.engine.clients.rights import rights_of
from mav_tasks.engine.clients.signatures import UNSIGNED, Signatures
from mav_tasks.engine.commands.command_request import row_said
from mav_tasks.engine.inputs import (
    Congestion,
    LinkChanged,
    Outgoing,
    Packets,
    Peer,
    PeerChanged,
    Place,
)
from mav_tasks.engine.packets import PacketSender
from mav_tasks.engine.policy import Row, row_of
from mav_tasks.engine.services.commands import Command, command_of, is_stop
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.engine.timers import Timer
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer, target_of
from mav_tasks.mavlink.enums import MavCmd, MavSeverity
from mav_tasks.mavlink.packet import (
    CRC,
    HEADER_V1,
    HEADER_V2,
    MAGIC_V2,
    SIGNATURE_LENGTH,
    SIGNED,
    Packet,
)
from mav_tasks.mavlink.signing import Key

_NUMBER = re.escape(int(MavCmd.TASK_STOP).to_bytes(2, "little"))
#: the start of a STOP, MAVLink 1 or 2: COMMAND_INT or COMMAND_LONG, with its command number
_STOP = re.compile(
    rb"\xfe.{4}[\x4b\x4c].{28}" + _NUMBER + rb"|\xfd.{6}[\x4b\x4c]\0\0.{28}" + _NUMBER, re.DOTALL
)
MOST_STOPS = 16  # from one datagram: routers put several packets into one


def stops_in(data: bytes) -> bytes:
    """Return the joined parts of a datagram that look like STOP packets, or b""."""
    found = islice(_STOP.finditer(data), MOST_STOPS)
    return b"".join(_packet_at(data, each.start()) for each in found)


def _packet_at(data: bytes, start: int) -> bytes:
    packet = data[start:]
    if packet[0] == MAGIC_V2:
        is_signed = packet[2] & SIGNED
        return packet[: packet[1] + HEADER_V2 + CRC + (SIGNATURE_LENGTH if is_signed else 0)]
    return packet[: packet[1] + HEADER_V1 + CRC]


MAX_LINK_NUMBER = 255  # limit of its field in TASK_STATUS
NEWCOMERS = 2.0  # new unsigned clients a second, on average; the burst is ``max_clients``
CROWDED = 2  # beyond ``max_clients`` / CROWDED, clients heard only once are forgotten after SILENT
GONE = 10.0  # s of silence, after which a client of any standing may replace this one
SILENT = 3.0  # s, after which a new client may replace this one; heartbeats come each second
STRANGERS = 500.0  # datagrams a second, of all senders on a link together that are no clients
SIZE = 64  # each so many bytes count as one more datagram, as many packets may be in one


class Received(NamedTuple):
    """A packet of a client. ``message`` is None if its id is not in the dialect.

    - ``arrived``: when it arrived on this machine, s, as ``Packets`` tells.
    - ``command``: the command in it, None if it is another message.
    - ``row``: its row in the policy table.
    """

    client: GcsClient
    packet: Packet
    message: m.Message | None
    key: Key
    arrived: float
    command: Command | None
    row: Row


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
        self._decoder = Decoder()
        #: the client links by name, with the limit of strangers' datagrams. Stream links need none:
        #: they have backpressure
        self.links: dict[str, TokenBucket | None] = {}
        #: count of datagrams dropped because they were too many
        self.left_out = 0
        #: number of each client link of this run, from 1
        self.link_numbers: dict[str, int] = {}
        self._clients: dict[Place, GcsClient] = {}
        #: all clients
        self.clients = self._clients.values()
        #: return a client by its key, None if it is gone
        self.client = self._clients.get
        #: counts of what came in on these links
        self.counts = self._decoder.counts
        self.statuses = statuses
        self.apply(settings)

    def change_link(self, change: LinkChanged, *, now: float) -> None:
        """Add a link that came up, remove one that went down."""
        if not change.up:
            self.links.pop(change.link, None)
            for key in [key for key in self._clients if key[0] == change.link]:
                del self._clients[key]
            return
        strangers = TokenBucket(rate=STRANGERS, burst=STRANGERS)
        self.links[change.link] = None if change.is_stream else strangers
        self.link_numbers.setdefault(change.link, min(len(self.link_numbers) + 1, MAX_LINK_NUMBER))
        for peer in change.peers:
            self._add(change.link, peer, now=now)

    def change_peer(self, change: PeerChanged, *, now: float) -> None:
        """Add a connection of a stream link, or remove it when it is closed."""
        self._clients.pop((change.link, change.peer), None)
        self._signatures.forget(change.link, change.peer)
        if change.up and change.link in self.links:
            self._add(change.link, change.peer, is_connected=True, now=now)

    def note_congestion(self, change: Congestion, *, now: float) -> None:
        """Hold back telemetry to an endpoint that is congested."""
        if client := self._clients.get((change.link, change.peer)):
            client.pace.note_congestion(change.is_congested, now=now)

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        most = float(settings.clients.max_clients)
        self._newcomers = TokenBucket(rate=NEWCOMERS, burst=most)
        for client in self.clients:
            client.apply(settings.clients)
            client.take_rights(rights_of(client.signed_by, client.who, settings.roles))

    def forget_unknown(self) -> list[Place]:
        """Forget clients whose key is no longer valid; configured ones become unheard.

        Return their links and endpoints.
        """
        clients = list(self._clients.items())
        unknown = [key for key, each in clients if not self._signatures.knows(each.signed_by)]
        for key in unknown:
            self._drop(key)
        return unknown

    def let_in(self, item: Packets, *, now: float) -> Packets:
        """Return the datagrams within the limits, and the STOPs of the others."""
        link = item.link
        strangers = self.links[link]
        if strangers is None:
            return item
        let_in: list[tuple[Peer, bytes]] = []
        times: list[float] = []
        is_whole = True
        for each, arrived in zip(item.datagrams, item.arrived or repeat(now), strict=False):
            peer, data = each
            client = self._clients.get((link, peer))
            limit = strangers if client is None else client.datagrams
            if not limit.take(tokens=1 + len(data) // SIZE, now=now):
                is_whole = False
                if not (stops := stops_in(data)):
                    continue
                each = peer, stops
            let_in.append(each)
            times.append(arrived)
        self.left_out += len(item.datagrams) - len(let_in)
        return item if is_whole else Packets(link, let_in, times)

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
        if client is None and message is not None:  # bytes without a checked CRC make no client
            client = self._admit(link, peer, packet, message, key=key, now=now)
        if client is None:
            return None
        if isinstance(message, m.CommandLong | m.CommandInt):
            command = command_of(message)
            row = row_said(command)
        else:
            command, row = None, row_of(packet.message_id, message)
        received = Received(client, packet, message, key, arrived, command, row)
        self.hear_out(received, now=now)
        if message is not None:
            client.heard(packet, now=now)
        return received

    def hear_out(self, received: Received, *, now: float) -> None:
        """Set a client's address, key and rights to those of this packet, which is in hand."""
        client, source, key = received.client, received.packet.source, received.key
        client.arrived, client.waited = received.arrived, now - received.arrived
        if source != client.source or key is not client.signed_by:
            self._know(client, source, key)

    def _know(self, client: GcsClient, source: Address, key: Key) -> None:
        client.source, client.signed_by = source, key
        client.who = client.submitter(source)
        client.take_rights(rights_of(key, client.who, self._settings.roles))

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
            if any(target.reaches(address) for address in client.addresses):
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

    def tell(self, text: str, severity: MavSeverity, source: Address, *, now: float) -> None:
        """Send a STATUSTEXT to every client."""
        for client in self.clients:
            client.tell(text, severity, source, now=now)

    def forget_silent(self, *, awaits: Callable[[str, str], bool], now: float) -> None:
        """Drop clients that have been silent for long; configured ones become unheard again.

        ``awaits``: whether a client at this link and endpoint waits for the end of a task; it is
        kept, however long that takes.
        """
        limits, is_crowd = self._settings.clients, self._is_crowd
        for key, client in list(self._clients.items()):
            most, is_connected = limits.forget_after, client.is_connected
            is_pushed = client.is_configured and not is_connected
            if is_pushed:
                most = limits.push_lost
            elif is_crowd and client.is_passing and not is_connected:
                most = SILENT
            if now - client.heard_at > most and (is_pushed or not awaits(key[0], client.endpoint)):
                self._drop(key)

    def _drop(self, key: Place) -> None:
        client = self._clients[key]
        if client.is_configured:
            client.is_heard = False
        else:
            del self._clients[key]
            self._signatures.forget(*key)

    def _add(self, link: str, peer: Peer, *, now: float, is_connected: bool = False) -> None:
        """Add a configured or connected client, even if there is no room for it."""
        self._has_room(NO_STANDING, now=now)
        client = self._clients[link, peer] = self._new(link, peer, now=now)
        client.is_configured, client.is_connected = True, is_connected

    def _new(self, link: str, peer: Peer, *, now: float) -> GcsClient:
        outlet = PacketSender(link, peer, self._queue, self._packer, self._signatures)
        settings = self._settings.clients
        return GcsClient(outlet, settings=settings, statuses=self.statuses, now=now)

    def _admit(
        self, link: str, peer: Peer, packet: Packet, message: m.Message, *, key: Key, now: float
    ) -> GcsClient | None:
        """Add a client and return it, or None if too many are active. A STOP needs no room.

        Otherwise a sender that keeps changing its endpoint would displace all clients, and have
        telemetry sent to all its endpoints. Who may do more comes first, and of those who may do
        the same the signed ones: anybody can pose as many unsigned ones.
        """
        is_signed = key is not UNSIGNED
        may_come = is_signed or self._newcomers.take(now=now)
        if not (may_come or is_stop(message)):
            return None
        client = self._new(link, peer, now=now)
        self._know(client, packet.source, key)
        if may_come and self._has_room(client.standing, now=now):
            client.is_one_of_many = self._is_crowd and not is_signed
            self._clients[link, peer] = client
            return client
        return client if is_stop(message) else None

    @property
    def _is_crowd(self) -> bool:
        return len(self._clients) > self._settings.clients.max_clients // CROWDED

    def _has_room(self, standing: tuple[int, bool], *, now: float) -> bool:
        """Whether there is room for a client of this standing; perhaps forget one in its place.

        That one has a lower standing, or the same and is silent, or has been silent for long.
        Silent ones go first: commands that have ended leave clients of any standing behind.
        """
        if len(self._clients) < self._settings.clients.max_clients:
            return True
        others = [
            (is_present, client.standing, client.heard_at, client.key)
            for client in self.clients
            if not client.is_configured
            and (
                (client.standing, is_present := now - client.heard_at < SILENT) < (standing, True)
                or now - client.heard_at >= GONE
            )
        ]
        if not others:
            return False
        self._drop(min(others, key=itemgetter(0, 1, 2))[3])
        return True
