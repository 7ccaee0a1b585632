"""Logs the vehicles' texts (STATUSTEXT), as an observer of the engine."""

import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf

from mav_tasks.engine.inputs import Input, LinkChanged, Packets, Peer, PeerChanged
from mav_tasks.engine.packets import PacketReader
from mav_tasks.engine.services.statustext import Text, TextReceiver
from mav_tasks.engine.services.token_bucket import TokenBucket
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.codec import DecodeCounts, Decoder
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Statustext
from mav_tasks.mavlink.packet import MAGIC_V1, Packet
from mav_tasks.mavlink.stream import is_whole
from mav_tasks.shell.logs.link_observer import LinkObserver
from mav_tasks.store.rendering import clean

RATE = 10.0  # texts per second of one vehicle; more are only counted
BURST = 50  # texts at once: an autopilot that starts sends many
COPIED = 5.0  # s in which a second link to a vehicle may bring a text once more
TELL = 30.0  # s from the first dropped text to the line with their number

TEXT = Statustext.id
_V2_ID = TEXT.to_bytes(3, "little")  # as in a MAVLink 2 header

log = logging.getLogger("mav_tasks")


@dataclass(frozen=True, slots=True)
class VehicleText:
    """A text from a vehicle's component, for the log."""

    vehicle: int
    component: int
    severity: MavSeverity
    text: str

    def __str__(self) -> str:
        part = "" if self.component == AUTOPILOT else f", component {self.component},"
        return f"rover {self.vehicle}{part} says: {self.text}"


@dataclass(slots=True)
class _Talk:
    limit: TokenBucket
    left_out: int = 0
    tell_at: float = inf
    #: by payload: the link and peer that brought a text last, and when
    latest: dict[bytes, tuple[tuple[str, Peer], float]] = field(default_factory=dict)

    def is_copy(self, payload: bytes, place: tuple[str, Peer], now: float) -> bool:
        """Return whether another link has just brought this text."""
        before, at = self.latest.get(payload, (place, -inf))
        if before != place and now - at < COPIED:
            return True
        if len(self.latest) >= BURST:
            self.latest.clear()
        self.latest[payload] = place, now
        return False


class VehicleTexts(LinkObserver):
    """Implements ``EngineObserver``: decodes texts, limits their rate, logs them."""

    def __init__(self) -> None:
        super().__init__()
        self._intake = PacketReader()
        self._counts = DecodeCounts()
        self._decoder = Decoder()
        self._receiver = TextReceiver()
        self._talks: dict[int, _Talk] = {}
        self._due = inf

    def __repr__(self) -> str:
        return f"VehicleTexts({self._receiver}, {len(self._talks)} vehicles)"

    def look(self, item: Input | None, *, now: float) -> None:
        """Log the texts in received packets."""
        if now >= self._due:
            self._handle_deadline(now)
        match item:
            case Packets() if item.link in self._links:
                for peer, packet in self._texts_in(item, now):
                    self._receive(packet, (item.link, peer), now)
            case LinkChanged():
                self._intake.change_link(item)
            case PeerChanged():
                self._intake.change_peer(item)

    def close(self) -> None:
        """Log incomplete texts and pending counts."""
        self._handle_deadline(inf)

    def _texts_in(self, item: Packets, now: float) -> Iterator[tuple[Peer, Packet]]:
        if not self._links[item.link]:
            datagrams = [
                each for each in item.datagrams if _may_hold_text(each[1]) or not is_whole(each[1])
            ]
            if not datagrams:
                return
            item = Packets(item.link, datagrams)
        for peer, packet, _ in self._intake.packets(item, self._counts, now=now):
            if packet.message_id == TEXT:
                yield peer, packet

    def _receive(self, packet: Packet, place: tuple[str, Peer], now: float) -> None:
        message = self._decoder.decode(packet)
        if not isinstance(message, Statustext):
            return
        talk = self._talks.get(packet.system_id)
        if talk is None:
            limit = TokenBucket(rate=RATE, burst=BURST, now=now)
            talk = self._talks[packet.system_id] = _Talk(limit)
        if talk.is_copy(packet.payload, place, now):
            return
        if not talk.limit.take(now=now):
            talk.left_out += 1
            talk.tell_at = min(talk.tell_at, now + TELL)
        else:
            for text in self._receiver.receive(packet.source, message, now=now):
                _say(text)
        self._plan()

    def _handle_deadline(self, now: float) -> None:
        for text in self._receiver.handle_deadline(now=now):
            _say(text)
        for vehicle, talk in self._talks.items():
            if talk.left_out and now >= talk.tell_at:
                log.warning("rover %d sends too many texts: %d omitted", vehicle, talk.left_out)
                talk.left_out, talk.tell_at = 0, inf
        self._plan()

    def _plan(self) -> None:
        tells = [talk.tell_at for talk in self._talks.values()]
        self._due = min(self._receiver.next_deadline(), *tells, inf)


def _may_hold_text(data: bytes) -> bool:
    """Whether a datagram may contain a STATUSTEXT: a cheap filter, as splitting is expensive."""
    return _V2_ID in data or (TEXT in data and MAGIC_V1 in data)


def _say(text: Text) -> None:
    words = clean(text.words).strip()
    if words:
        vehicle, component = text.sender
        log.log(_level(text.severity), VehicleText(vehicle, component, text.severity, words))


def _level(severity: MavSeverity) -> int:
    if severity <= MavSeverity.ERROR:
        return logging.ERROR
    if severity == MavSeverity.WARNING:
        return logging.WARNING
    return logging.INFO if severity <= MavSeverity.INFO else logging.DEBUG
