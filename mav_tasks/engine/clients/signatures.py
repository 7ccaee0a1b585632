"""Checks the signatures of incoming packets, and signs outgoing ones (MAVLink 2 signing).

On a client link every key of the ring is valid, on a vehicle link only the link's own key. A packet
is accepted once, also over restarts: the timestamps go to the store.
"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide, Outgoing, Peer, Place
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.packet import MAGIC_V2, Packet
from mav_tasks.mavlink.signing import (
    FROM_RADIOS,
    HIGHEST_TIMESTAMP,
    UNITS,
    Key,
    Signer,
    Stream,
    StreamTimes,
    Window,
    is_signed_with,
    stream_of,
    timestamp_at,
    timestamp_of,
)
from mav_tasks.tasks.events import SignatureRefused, SignaturesSeen, SignatureTime
from mav_tasks.tasks.fleet import DECAY, STEP

#: stands for the key of unsigned packets, where they are allowed
UNSIGNED = Key("", b"", fingerprint="-")

#: messages that do no harm if they are replayed: clocks, questions, heartbeats
HARMLESS = frozenset({m.Heartbeat.id, m.Timesync.id, m.SystemTime.id, m.Ping.id})
#: messages that come so often while a client drives that their time is stored each second only
STREAMED = frozenset(
    {
        *(m.ManualControl.id, m.RcChannelsOverride.id, m.SetPositionTargetLocalNed.id),
        *(m.SetPositionTargetGlobalInt.id, m.SetAttitudeTarget.id),
        m.SetActuatorControlTarget.id,
    }
)
#: s, within which a timestamp goes to the store. A minute, because each write is some 13 kB on the
#: disk: each second it would be 1.1 GB a day for one idle station
HARMLESS_WITHIN, STREAMED_WITHIN = 60.0, 1.0
#: link id of what only the gateway that has a vehicle signs to it, over all links and gateways
FENCE_LINK_ID = 254
BEHIND = int(50 * UNITS)  # behind a vehicle's time, at most: it takes no new stream a minute behind
RESERVE = int(120 * UNITS)  # own timestamps stored ahead: none is used twice if a clock is set back
#: a signature later than our clock by more than this follows the time of the other end. By less:
#: each packet is signed later than the one before, 10,000 of them in one moment
COUNTED = int(0.1 * UNITS)
#: by how much the clock may be behind what was signed before without having been set back: another
#: gateway of the fleet may have signed that
CLOCKS_APART = int(5 * UNITS)
#: a clock before 2020 was never set: the computer has no battery for it, and no network
SET_SINCE = timestamp_at(1_577_836_800.0)
TELL_EACH = 60.0  # s between log lines about one key whose clock is wrong
MOST_SIGNERS = 1024
MOST_OWN = 4096  # own streams remembered
HIGHEST_LINK_ID = 255


@dataclass(slots=True)
class SignatureCounts:
    """Counts of refused packets, by reason."""

    unsigned: int = 0  # where unsigned packets are not allowed
    unverified: int = 0  # signed with an unknown key, or changed on the way
    old: int = 0  # valid, but not newer than one before, or held back: replayed or overtaken
    ahead: int = 0  # valid, but its clock is ahead of ours


class _Link(NamedTuple):
    number: int
    is_of_vehicles: bool
    takes_unsigned: bool
    key: str  # its name


NO_LINK = _Link(0, is_of_vehicles=True, takes_unsigned=True, key="")


class Signatures:
    """The keys, and the timestamps of signatures on all links."""

    def __init__(
        self,
        *,
        window: float,
        times: tuple[SignatureTime, ...] = (),
        signed_until: int = 0,
    ) -> None:
        """``window`` is in seconds; ``times`` and ``signed_until`` come from the store."""
        self.apply(window)
        self._keys: dict[str, Key] = {}  # with a secret, by name
        self._has_ring = False
        self._links: dict[str, _Link] = {}
        self._times: dict[str, StreamTimes] = {}  # by fingerprint
        self._signers: dict[Place, Signer] = {}
        self._fenced: dict[Place, Signer] = {}  # to vehicles of a fleet that are ours
        self._lead = (0.0, 0.0)  # s ahead of our clock, and when it was that
        #: the lead with which each way began to be signed as a vehicle of ours
        self._began: dict[Place, tuple[float, float]] = {}
        #: whether there is a key or an endpoint to sign for
        self.may_sign = False
        self._offset: float | None = None  # UTC less ``now``
        self._highest_offset = -inf  # in this run: a clock that is set back locks no sender out
        #: timestamps of packets that we signed, by side, key, link id and source
        self._own: dict[tuple[bool, str, int, int, int], int] = {}
        #: timestamps not given to the store yet; 0: the stream is forgotten
        self._heard: dict[tuple[str, Stream], int] = {}
        #: when timestamps are to be given to the store
        self.keep_at = inf
        self._signed_until = signed_until  # as the store has it
        self._highest = 0
        self.is_used_up = False  #: own timestamps must be stored ahead again
        self._from = signed_until  # least own timestamp, until the clock is known
        self._known_until = signed_until  # latest time that an earlier run knew
        self._told: dict[str, float] = {}  # by key, when its wrong clock was reported
        #: reports of wrong clocks, for the journal and the log, which take them out
        self.refused: list[SignatureRefused] = []
        #: monotonic seconds; set before anything is signed or checked
        self.now = 0.0
        self.counts = SignatureCounts()
        for time in times:
            stream = Stream(time.link_id, Address(time.system_id, time.component_id))
            times_of = self._times.setdefault(time.key, StreamTimes())
            times_of.restore(stream, time.timestamp)

    def __repr__(self) -> str:
        return f"Signatures({sorted(self._keys)}, {self.counts})"

    def apply(self, window: float) -> None:
        """Take a new window, in seconds."""
        self._window = int(window * UNITS)

    def set_wall(self, offset: float) -> None:
        """Take the offset of the wall clock, UTC less ``now``, in seconds."""
        self._offset = offset
        self._highest_offset = max(self._highest_offset, offset)
        clock = self._clock()
        stored_at = self._signed_until - RESERVE
        is_set_back = clock < stored_at - CLOCKS_APART
        self._from = self._signed_until if is_set_back else max(0, stored_at + COUNTED)

    def change_keys(self, change: KeysChanged) -> set[str]:
        """Replace the keys. No longer sign for endpoints whose key was removed or changed.

        Return the names of keys that are no longer valid; at the first call, of revoked ones.
        """
        before, self._keys = self._keys, {key.name: key for key in change.keys if key.secret}
        now = {key.name: key.fingerprint for key in self._keys.values()}
        gone = {name for name, key in before.items() if now.get(name) != key.fingerprint}
        if not self._has_ring:
            gone = {key.name for key in change.keys if not key.secret}
        self._has_ring = True
        for way, signer in list(self._signers.items()):
            # Vehicles of a link that has lost its key without a new one take no other signature.
            # Their packets are refused, so they are not driven; but commands to stand are still
            # signed with the old key
            there = self._links[way[0]]
            is_last = there.is_of_vehicles and there.key not in self._keys
            if not self.knows(signer.key) and not is_last:
                del self._signers[way]  # also if only its role changed
        self.may_sign = bool(self._keys or self._signers)
        return gone

    def change_link(self, change: LinkChanged) -> None:
        """Add a link with its key and rules when it comes up, remove it when it goes down."""
        if not change.up:
            for signers in (self._signers, self._fenced):
                for way in [way for way in signers if way[0] == change.link]:
                    del signers[way]
        number = self._links.get(change.link, NO_LINK).number or len(self._links) + 1
        self._links[change.link] = _Link(
            min(number, HIGHEST_LINK_ID),
            change.side is LinkSide.VEHICLES,
            change.takes_unsigned,
            change.key if change.up else "",
        )

    def forget(self, link: str, peer: Peer) -> None:
        """Forget the key of an endpoint: its sender is gone, or another one is there."""
        self._signers.pop((link, peer), None)

    def knows(self, key: Key) -> bool:
        """Whether a key is still valid; UNSIGNED is."""
        return key is UNSIGNED or self._keys.get(key.name) == key

    def set_up(self, link: str, peer: Peer, secret: bytes) -> str:
        """Sign packets to a client with the key that has this secret; with zeros not at all.

        Return why not, "" if so. It gives no rights, and adds no key to the ring.
        """
        if not any(secret):
            if not self._links.get(link, NO_LINK).takes_unsigned:
                return "this link requires signed packets"
            self.forget(link, peer)
            return ""
        for key in self._keys.values():
            if key.secret == secret and key.role:
                self._signer(link, peer, key)
                return ""
        return "this server has no such key for clients"

    def has_key(self, link: str) -> bool:
        """Whether a link has a key of its own."""
        return bool(self._links.get(link, NO_LINK).key)

    # incoming packets

    def admit(self, link: str, peer: Peer, packet: Packet) -> Key | None:
        """Return the signing key of a packet of good CRC, or UNSIGNED; None to drop it."""
        there = self._links.get(link, NO_LINK)
        # whether there is any key to check a signature with
        matters = there.key if there.is_of_vehicles else self._has_ring
        if not matters or not packet.is_signed:
            # radios cannot sign; the status of a client's radio says nothing of a rover's link
            is_of_radio = packet.message_id in FROM_RADIOS and there.is_of_vehicles
            if there.takes_unsigned or is_of_radio:
                return UNSIGNED
            self.counts.unsigned += 1
            return None
        key = self._signed_with(there, link, peer, packet)
        if key is None:
            self.counts.unverified += 1
            return None
        stream, timestamp = stream_of(packet), timestamp_of(packet)
        times = self._times.setdefault(key.fingerprint, StreamTimes())
        own = there.is_of_vehicles, key.fingerprint, stream.link_id, *stream.source
        if timestamp <= self._own.get(own, -1):
            self.counts.old += 1  # our own packet, sent back by an eavesdropper
            return None
        window = self._believed(there)
        if not times.is_news(stream, timestamp, window):
            self._refuse(key, peer, packet, window)
            return None
        gone = times.note(stream, timestamp, window)
        if gone is not None:
            self._heard[key.fingerprint, gone] = 0
        self._heard[key.fingerprint, stream] = timestamp
        self.keep_at = min(self.keep_at, self.now + _kept_within(there, packet))
        self._signer(link, peer, key).heard(timestamp)
        return key

    def _believed(self, link: _Link) -> Window:
        """Return the window of timestamps that are accepted on a link.

        It has no upper bound while our clock is not set, or is behind what an earlier run signed;
        nor on a vehicle link, because a vehicle with GPS may be ahead.
        """
        clock, newest, latest = self._clock(), HIGHEST_TIMESTAMP, HIGHEST_TIMESTAMP
        is_set = clock >= max(SET_SINCE, self._known_until - RESERVE)
        if is_set and not link.is_of_vehicles:
            known = max(timestamp_at(self.now + self._highest_offset), self._known_until)
            newest, latest = clock + self._window, known + self._window
        return Window(clock - self._window, newest, latest, self._window, self.now)

    def _refuse(self, key: Key, peer: Peer, packet: Packet, window: Window) -> None:
        """Count a packet outside the window, and report a wrong clock."""
        timestamp = timestamp_of(packet)
        is_ahead = timestamp > window.newest
        self.counts.ahead += is_ahead
        self.counts.old += not is_ahead
        told = self._told.get(key.fingerprint, -inf)
        if window.oldest <= timestamp <= window.newest or self.now - told < TELL_EACH:
            return
        self._told[key.fingerprint] = self.now
        actor = f"{packet.source}@{peer} signed {key.name}"
        self.refused.append(SignatureRefused(actor, (self._clock() - timestamp) / UNITS, self.now))

    def _signed_with(self, there: _Link, link: str, peer: Peer, packet: Packet) -> Key | None:
        if there.is_of_vehicles:
            keys = [self._keys[there.key]] if there.key in self._keys else []
        else:
            signer = self._signers.get((link, peer))
            keys = [] if signer is None else [signer.key]
            keys = [key for key in (*keys, *self._keys.values()) if key.role]
        return next((key for key in keys if is_signed_with(packet, key.secret)), None)

    # outgoing packets

    def sealed(self, link: str, peer: Peer, raw: bytes) -> bytes:
        """Return a packet as it leaves: signed, if its endpoint or link has a key."""
        signer = self._signers.get((link, peer))
        if signer is None:
            key = self._keys.get(self._links.get(link, NO_LINK).key)
            if key is None:
                return raw
            signer = self._signer(link, peer, key)
        clock = self._own_clock()
        sealed = self._signed(link, signer, raw, clock=clock)
        if signer.last <= clock + COUNTED:  # beyond, it is the other end's time, for it alone
            self._highest = max(self._highest, signer.last)
            self.is_used_up = self._signed_until < self._highest + RESERVE // 2
        return sealed

    def sealed_as_holder(self, link: str, peer: Peer, raw: bytes) -> bytes:
        """Return a packet to a vehicle of a fleet that is ours, as it leaves.

        All gateways sign with one link id to it, each with a lead over the one before: so the
        vehicle refuses what a gateway signs that does not have it any more. This follows no
        vehicle's time, which others hear, too, but where it would be refused for being old; and
        once, when it gets the vehicle: what the one before has signed is not later than that time.
        """
        key = self._keys.get(self._links.get(link, NO_LINK).key)
        if key is None:
            return self.sealed(link, peer, raw)
        signer = self._fenced.get((link, peer))
        if signer is None or signer.key != key:
            signer = self._fenced[link, peer] = Signer(key, link_id=FENCE_LINK_ID)
        heard = self._signer(link, peer, key).last
        clock = self._own_clock() + int(max(0.0, self._lead_left()) * UNITS)
        if self._began.get((link, peer)) != self._lead:
            self._began[link, peer] = self._lead
            if heard > clock:
                signer.heard(heard + int(STEP * UNITS))
        return self._signed(link, signer, raw, clock=max(clock, heard - BEHIND))

    def take_lead(self, lead: float) -> None:
        """Sign at least so many seconds ahead of our clock to vehicles that are ours."""
        self._lead = max(lead, self._lead_left()), self.now

    def _lead_left(self) -> float:
        lead, since = self._lead
        return lead - DECAY * (self.now - since)

    def _signed(self, link: str, signer: Signer, raw: bytes, *, clock: int) -> bytes:
        """Return a packet with its signature, and note that this is ours."""
        sealed = signer.sign(raw, clock=clock)
        if raw[0] == MAGIC_V2:
            is_of_vehicles = self._links[link].is_of_vehicles
            own = is_of_vehicles, signer.key.fingerprint, signer.link_id, raw[5], raw[6]
            if own not in self._own and len(self._own) >= MOST_OWN:
                del self._own[next(iter(self._own))]
            self._own[own] = max(signer.last, self._own.get(own, 0))
        return sealed

    def sealed_late(self, outgoing: Outgoing) -> Outgoing:
        """Return a packet that was made long before, signed for sending now."""
        link, peer, raw = outgoing.link, outgoing.peer, outgoing.data
        is_held = (link, peer) in self._fenced
        data = self.sealed_as_holder(link, peer, raw) if is_held else self.sealed(link, peer, raw)
        return outgoing._replace(data=data)

    def _signer(self, link: str, peer: Peer, key: Key) -> Signer:
        signer = self._signers.get((link, peer))
        if signer is None or signer.key != key:
            signer = Signer(key, link_id=self._links[link].number)
            # a forgotten signer may have been ahead of the clock, by one unit for each packet
            signer.last = min(self._highest, self._own_clock() + int(UNITS))
            keep_latest(self._signers, (link, peer), signer, most=MOST_SIGNERS)
        return signer

    def _clock(self) -> int:
        return 0 if self._offset is None else timestamp_at(self.now + self._offset)

    def _own_clock(self) -> int:
        """Return the time for own signatures: never one that an earlier run used."""
        return max(self._clock(), self._from)

    # timestamps for the store

    def take_times(self) -> SignaturesSeen:
        """Return the timestamps to be stored: at ``keep_at``, or if own ones are used up."""
        if self.is_used_up:
            self._signed_until, self.is_used_up = self._highest + RESERVE, False
        times = [
            SignatureTime(fingerprint, stream.link_id, *stream.source, timestamp)
            for (fingerprint, stream), timestamp in self._heard.items()
        ]
        heard = tuple(time for time in times if time.timestamp)
        gone = tuple(time for time in times if not time.timestamp)
        self._heard.clear()
        self.keep_at = inf
        return SignaturesSeen(heard, gone, self._signed_until, self.now)


def _kept_within(link: _Link, packet: Packet) -> float:
    """Return the seconds within which a packet's timestamp must go to the store."""
    if packet.message_id in HARMLESS or link.is_of_vehicles:
        return HARMLESS_WITHIN
    return STREAMED_WITHIN if packet.message_id in STREAMED else 0.0
