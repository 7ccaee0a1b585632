"""A rover as its links see it: datagrams in, datagrams out; inside, an autopilot drives a body.

It never sends first: it talks to peers from which it has recently received valid MAVLink, and sends
everything to each of them, as the real one does on a link.
"""

from collections.abc import Hashable, Sequence
from enum import Enum

from mav_tasks.links.base import Link
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.signing import Key
from mav_tasks.mavlink.stream import PeerStreams
from rover_sim.actuators import with_blocked
from rover_sim.autopilot import Autopilot
from rover_sim.body import Body, BodyState, Pose, turned, wrap_angle
from rover_sim.geo import DEFAULT_ORIGIN, Origin
from rover_sim.motion import CONTROL_PERIOD, LAGS, Motors
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
        uid: int | None = None,
    ) -> None:
        """Put an autopilot that was just powered on into a body.

        ``realism`` None is the default of the persona; ``seed`` draws its random values.

        ``unix_offset`` is Unix time minus ``now``; 0 if there is no wall clock (SYSTEM_TIME then
        says unknown). With a ``key``, the rover signs and accepts only packets signed with that
        key. ``uid`` None is the system id.
        """
        self.body = body
        self.autopilot = Autopilot(
            Address(system_id, AUTOPILOT),
            persona=persona,
            origin=origin,
            unix_offset=unix_offset,
            truth=body.state,
            now=now,
            realism=realism or persona.realism,
            seed=seed,
            uid=uid or system_id,
        )
        self._motors = Motors(wanted=LAGS[persona.frame], body=body.lag)
        self._frame = persona.frame
        self._offset: Pose | None = None  # of the body's frame; None: not moved yet
        self._answers = peers
        self._signatures = None if key is None else RoverSignatures(key, unix_offset=unix_offset)
        self._streams = PeerStreams(is_stream=False)
        self._decoder = Decoder()
        self._encoder = Encoder(self.autopilot.address)
        self._peers: dict[Hashable, float] = {}
        self._outgoing: list[tuple[Hashable, bytes]] = []
        self._next_step = now
        self._boots = 0

    def __repr__(self) -> str:
        return f"Vehicle({self.autopilot!r}, {len(self._peers)} peers)"

    @property
    def truth(self) -> BodyState:
        """The rover's true state."""
        state, offset = self.body.state, self._offset
        if offset is None:
            return state
        north, east = turned(state.north, state.east, offset.yaw)
        yaw = wrap_angle(offset.yaw + state.yaw)
        return state._replace(north=offset.north + north, east=offset.east + east, yaw=yaw)

    def place(self, pose: Pose) -> None:
        """Put the rover down at this pose. It keeps its motion relative to its heading.

        The ground is the same everywhere, so this moves the ground's frame under the rover.
        """
        state = self.body.state
        turn = wrap_angle(pose.yaw - state.yaw)
        north, east = turned(state.north, state.east, turn)
        self._offset = Pose(pose.north - north, pose.east - east, turn)

    def push(self, forward: float, right: float, turn: float) -> None:
        """Move the rover by metres along its own axes, then turn it clockwise by radians."""
        state = self.truth
        north, east = turned(forward, right, state.yaw)
        self.place(Pose(state.north + north, state.east + east, state.yaw + turn))

    def receive(self, data: bytes, peer: Hashable, *, now: float) -> None:
        """Take a datagram of any bytes. Raise only SimulatedCrash."""
        for packet in self._streams.feed(peer, data, now=now):
            if self._signatures is not None and not self._signatures.believes(packet, now=now):
                continue
            message = self._decoder.decode(packet)
            if message is not None:
                if self._answers is Peers.ALL or not self._peers or peer in self._peers:
                    self._peers[peer] = now
                self.autopilot.handle(message, packet.source, now=now)
        self._collect()

    def next_deadline(self) -> float:
        """Return when the next control step or delayed message is due."""
        return min(self._next_step, self.autopilot.outbox.next_release)

    def handle_deadline(self, *, now: float) -> None:
        """Run every control step that is due by ``now``; an early or repeated call does nothing."""
        autopilot, body = self.autopilot, self.body
        self._next_step = max(self._next_step, now - MAX_CATCH_UP)
        while self._next_step <= now:
            at = self._next_step
            autopilot.outbox.release(at)
            motion = autopilot.step(self.truth, now=at)
            self._collect()
            blocked = autopilot.faults.wheels_blocked
            body.drive(*with_blocked(self._motors.step(motion), blocked, self._frame))
            body.advance(CONTROL_PERIOD)
            self._next_step = at + CONTROL_PERIOD
        autopilot.outbox.release(now)
        self._collect()

    def take_packets(self) -> list[tuple[Hashable, bytes]]:
        """Return the packets to send: one datagram each, in order."""
        taken, self._outgoing = self._outgoing, []
        return taken

    def _collect(self) -> None:
        messages = self.autopilot.outbox.take()
        if self._boots != self.autopilot.boots:  # its sequence numbers restart, too
            self._boots = self.autopilot.boots
            self._encoder = Encoder(self.autopilot.address)
        if messages and self._answers is Peers.ALL:
            oldest = self._next_step - PEER_TIMEOUT
            self._peers = {peer: at for peer, at in self._peers.items() if at >= oldest}
        for message in messages:
            packet = self._encoder.encode(message)
            if self._signatures is not None:
                packet = self._signatures.sealed(packet, now=self._next_step)
            self._outgoing.extend((peer, packet) for peer in self._peers)


make_vehicle = Vehicle  # the name that tests and tools call it by


def exchange(link: Link, vehicles: Sequence[Vehicle], now: float, most: int) -> None:
    """Let vehicles on a link take ``most`` datagrams, run due control steps, and send."""
    for peer, data in link.receive(most) if most else ():
        for vehicle in vehicles:
            vehicle.receive(data, peer, now=now)
    for vehicle in vehicles:
        vehicle.handle_deadline(now=now)
        for peer, packet in vehicle.take_packets():
            link.send(peer, packet)
