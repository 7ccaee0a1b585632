"""A rover as its links see it: datagrams in, datagrams out; inside, an autopilot drives a body.

It never sends first: it talks to peers from which it has recently received valid MAVLink, and sends
everything to each of them, as the real one does on a link.
"""

from collections.abc import Hashable
from enum import Enum

from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.signing import Key
from mav_tasks.mavlink.stream import PeerStreams
from rover_sim.autopilot import Autopilot
from rover_sim.body import Body, BodyState
from rover_sim.geo import DEFAULT_ORIGIN, Origin
from rover_sim.motion import CONTROL_PERIOD
from rover_sim.motors import LAGS, Motors
from rover_sim.personas import ARDUPILOT, Persona
from rover_sim.realism import Realism
from rover_sim.signatures import RoverSignatures

PEER_TIMEOUT = 10.0  # s of silence until a peer is dropped
MAX_CATCH_UP = 0.5  # s; a vehicle delayed for longer loses the time, as on a stalled machine


class Peers(Enum):
    """Which peers a rover answers on its socket."""

    ALL = "all"
    FIRST = "first"  # PX4's own link: only the first peer, until a restart


class Vehicle:
    """One rover. The caller passes the time, s, which starts with the constructor's ``now``."""

    def __init__(
        self,
        *,
        body: Body,
        autopilot: Autopilot,
        now: float,
        signatures: RoverSignatures | None = None,
        peers: Peers = Peers.ALL,
        motors: Motors | None = None,
    ) -> None:
        """Create a vehicle; ``motors`` is the lag between autopilot and body, None for no lag."""
        self._motors = motors
        self._answers = peers
        self.body = body
        self._signatures = signatures
        self.autopilot = autopilot
        self._streams = PeerStreams(is_stream=False)
        self._decoder = Decoder()
        self._encoder = Encoder(autopilot.address)
        self._peers: dict[Hashable, float] = {}
        self._outgoing: list[tuple[Hashable, bytes]] = []
        self._next_step = now
        self._boots = autopilot.boots

    def __repr__(self) -> str:
        return f"Vehicle({self.autopilot!r}, {len(self._peers)} peers)"

    @property
    def truth(self) -> BodyState:
        """The rover's true state."""
        return self.body.state

    def receive(self, data: bytes, peer: Hashable, *, now: float) -> None:
        """Take a datagram of any bytes. Raise only SimulatedCrash."""
        for packet in self._streams.feed(peer, data, now=now):
            if self._signatures is not None and not self._signatures.believes(packet, now=now):
                continue
            message = self._decoder.decode(packet)
            if message is not None:
                self._meet(peer, now)
                self.autopilot.handle(message, packet.source, now=now)
        self._collect()

    def next_deadline(self) -> float:
        """Return when the next control step or delayed message is due."""
        return min(self._next_step, self.autopilot.next_release)

    def handle_deadline(self, *, now: float) -> None:
        """Run every control step that is due by ``now``; an early or repeated call does nothing."""
        if now - self._next_step > MAX_CATCH_UP:
            self._next_step = now - MAX_CATCH_UP
        while self._next_step <= now:
            at = self._next_step
            self.autopilot.release(now=at)
            motion = self.autopilot.step(self.body.state, now=at)
            self._collect()
            self.body.drive(*(motion if self._motors is None else self._motors.step(motion)))
            self.body.advance(CONTROL_PERIOD)
            self._next_step = at + CONTROL_PERIOD
        self.autopilot.release(now=now)
        self._collect()

    def take_packets(self) -> list[tuple[Hashable, bytes]]:
        """Return the packets to send: one datagram each, in order."""
        taken, self._outgoing = self._outgoing, []
        return taken

    def _meet(self, peer: Hashable, now: float) -> None:
        if self._answers is Peers.ALL or not self._peers or peer in self._peers:
            self._peers[peer] = now

    def _collect(self) -> None:
        messages = self.autopilot.take_messages()
        if self._boots != self.autopilot.boots:  # its sequence numbers restart, too
            self._boots = self.autopilot.boots
            self._encoder = Encoder(self.autopilot.address)
        if not messages:
            return
        self._forget_silent_peers()
        for message in messages:
            packet = self._encoder.encode(message)
            if self._signatures is not None:
                packet = self._signatures.sealed(packet, now=self._next_step)
            self._outgoing.extend((peer, packet) for peer in self._peers)

    def _forget_silent_peers(self) -> None:
        if self._answers is Peers.FIRST:
            return
        oldest = self._next_step - PEER_TIMEOUT
        silent = [peer for peer, heard in self._peers.items() if heard < oldest]
        for peer in silent:
            del self._peers[peer]


def make_vehicle(
    body: Body,
    *,
    system_id: int,
    now: float,
    persona: Persona = ARDUPILOT,
    origin: Origin = DEFAULT_ORIGIN,
    unix_offset: float = 0.0,
    key: Key | None = None,
    realism: Realism | None = None,
    seed: int = 0,
    peers: Peers = Peers.ALL,
) -> Vehicle:
    """Put an autopilot that was just powered on into a body.

    ``realism`` None is the default of the persona; ``seed`` draws its random values.

    ``unix_offset`` is Unix time minus ``now``; 0 if there is no wall clock (SYSTEM_TIME then says
    unknown). With a ``key``, the rover signs and accepts only packets signed with that key.
    """
    kind = persona.realism if realism is None else realism
    autopilot = Autopilot(
        system_id=system_id,
        persona=persona,
        origin=origin,
        unix_offset=unix_offset,
        truth=body.state,
        now=now,
        realism=kind,
        seed=seed,
    )
    signatures = None if key is None else RoverSignatures(key, unix_offset=unix_offset)
    motors = Motors(wanted=LAGS[persona.frame], body=body.lag)
    return Vehicle(
        body=body, autopilot=autopilot, now=now, signatures=signatures, peers=peers, motors=motors
    )
