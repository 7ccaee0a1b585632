"""The driver of simulated rovers in virtual time: MAVLink bytes in, bytes and true pose out."""

from collections.abc import Callable, Hashable
from dataclasses import replace
from functools import partial
from math import nan
from typing import TypeVar

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import split_datagram
from rover_sim.body import BodyState, Pose
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import ARDUPILOT, PX4, Persona
from rover_sim.realism import NO_BOOT, Realism
from rover_sim.vehicle import make_vehicle

CLIENT = Address(250, 191)
ROVER = Address(1, 1)
ORIGIN = Pose()
PEER = "client"
START = 1000.0  # s
VELOCITY = 0x0DC7  # type masks: velocity only
POSITION = 0x0DF8
LOCAL_NED, LOCAL_OFFSET_NED, BODY_NED = 1, 7, 8
MANUAL, HOLD, AUTO, RTL, GUIDED, INITIALISING = 0, 4, 10, 11, 15, 16
PX4_HOLD, PX4_MISSION, PX4_RTL = 0x03040000, 0x04040000, 0x05040000
PX4_OFFBOARD = 6 << 16
ARMED = 128
READY = 1.0  # s after which a rover has started and can be armed

M = TypeVar("M", bound=Message)


def command_long(command: int, *params: float) -> m.CommandLong:
    return m.CommandLong(1, 1, command, 0, *params, *(0.0,) * (7 - len(params)))


def calm(persona: Persona) -> Realism:
    """Return the realism of a rover that knows its place, is ready at once and answers at once."""
    timing = replace(persona.realism.timing, first_answer=0.0, last_answer=0.0, in_pairs=False)
    return replace(persona.realism, estimator=None, timing=timing, boot=NO_BOOT)


class Rig:
    """One rover with system id 1, and what its client hears."""

    def __init__(
        self,
        persona: Persona = ARDUPILOT,
        *,
        start: Pose = ORIGIN,
        slip: float = 0.3,
        wait: float = READY,
        realism_of: Callable[[Persona], Realism] = calm,
        seed: int = 0,
    ) -> None:
        self.now = START
        self.speaks_px4 = persona.name != "ardupilot"
        body = kinematic_body(persona.frame, start=start, slip=slip, seed=None)
        realism = realism_of(persona)
        self.vehicle = make_vehicle(
            body, system_id=1, persona=persona, now=self.now, realism=realism, seed=seed
        )
        self.autopilot = self.vehicle.autopilot
        self.heard: list[Message] = []
        self._decoder = Decoder()
        self._encoder = Encoder(CLIENT)
        self.send(heartbeat())
        self.run(wait)

    @property
    def truth(self) -> BodyState:
        return self.vehicle.truth

    def send(self, *outgoing: Message, peer: Hashable = PEER) -> None:
        for message in outgoing:
            self.vehicle.receive(self._encoder.encode(message), peer, now=self.now)
        self._listen()

    def send_from(self, sender: Address, message: Message) -> None:
        self.vehicle.receive(Encoder(sender).encode(message), PEER, now=self.now)
        self._listen()

    def run(self, seconds: float, stream: Message | None = None, *, rate: float = 20.0) -> None:
        """Let time pass; a stream is sent at its rate all the while."""
        end = self.now + seconds
        next_send = self.now
        next_heartbeat = self.now + 1.0
        while True:
            at = min(self.vehicle.next_deadline(), next_heartbeat)
            if stream is not None:
                at = min(at, next_send)
            if at > end - 1e-9:
                break
            self.now = at
            if stream is not None and at == next_send:
                next_send += 1.0 / rate
                self.send(stream)
            elif at == next_heartbeat:
                next_heartbeat += 1.0
                self.send(heartbeat())
            self.vehicle.handle_deadline(now=at)
            self._listen()
        self.now = end

    def until(self, condition: Callable[[], bool], *, limit: float) -> float:
        """Run until something holds; give how long it took."""
        began = self.now
        while not condition():
            assert self.now - began < limit, f"not within {limit} s"
            self.run(0.025)
        return self.now - began

    def command(self, command: int, *params: float) -> MavResult:
        """Send a COMMAND_LONG and give the result of its one and only answer."""
        return self._answer_to(command_long(command, *params))

    def command_int(self, command: int, *, frame: int, x: int, y: int, param2: float) -> MavResult:
        return self._answer_to(
            m.CommandInt(1, 1, frame, command, 0, 0, -1.0, param2, 0.0, nan, x, y, 0.0)
        )

    def set_mode(self, custom_mode: int) -> MavResult:
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
        params = (main, sub, nan) if self.speaks_px4 else (custom_mode,)
        return self.command(MavCmd.DO_SET_MODE, 1, *params)

    def arm(self) -> MavResult:
        return self.command(MavCmd.COMPONENT_ARM_DISARM, 1)

    def mode(self) -> int:
        """The mode as HEARTBEAT has it, without waiting for the next one."""
        self.command(MavCmd.REQUEST_MESSAGE, m.Heartbeat.id)
        return int(self.last(m.Heartbeat).custom_mode)

    def ready_to_drive(self) -> None:
        """GUIDED and armed, or armed in HOLD and then OFFBOARD on a stream of zeros."""
        if self.speaks_px4:
            assert self.arm() == MavResult.ACCEPTED
            self.run(1.0, velocity(0.0))
            assert self.set_mode(PX4_OFFBOARD) == MavResult.ACCEPTED
        else:
            assert self.set_mode(GUIDED) == MavResult.ACCEPTED
            assert self.arm() == MavResult.ACCEPTED

    def take(self, kind: type[M]) -> list[M]:
        """Return what was heard of a kind, and forget everything heard."""
        taken = [message for message in self.heard if isinstance(message, kind)]
        self.heard.clear()
        return taken

    def last(self, kind: type[M]) -> M:
        return [message for message in self.heard if isinstance(message, kind)][-1]

    def texts(self) -> list[str]:
        """Every STATUSTEXT since the last ``take``."""
        return [t.text.rstrip("\0") for t in self.heard if isinstance(t, m.Statustext)]

    def _answer_to(self, message: m.CommandLong | m.CommandInt) -> MavResult:
        before = len(self.heard)
        self.send(message)
        acks = [a for a in self.heard[before:] if isinstance(a, m.CommandAck)]
        assert [a.command for a in acks] == [message.command]
        assert (acks[0].progress, acks[0].result_param2) == (0, 0)
        assert Address(acks[0].target_system, acks[0].target_component) == CLIENT
        return MavResult(acks[0].result)

    def _listen(self) -> None:
        for peer, data in self.vehicle.take_packets():
            if peer == PEER:
                (packet,) = split_datagram(data)
                assert packet.source == ROVER
                message = self._decoder.decode(packet)
                assert message is not None
                self.heard.append(message)


#: one that speaks as PX4 does
Px4Rig = partial(Rig, PX4)
#: one as unkind as its make
RealRig = partial(Rig, realism_of=lambda persona: persona.realism, seed=1, wait=0.0)


def heartbeat() -> m.Heartbeat:
    return m.Heartbeat(6, 8, 0, 0, 4, 3)


def local_target(
    mask: int,
    *,
    frame: int = LOCAL_NED,
    position: tuple[float, float] = (0.0, 0.0),
    velocity: tuple[float, float] = (0.0, 0.0),
    target: Address = ROVER,
) -> m.SetPositionTargetLocalNed:
    return m.SetPositionTargetLocalNed(
        0, *target, frame, mask, *position, 0.0, *velocity, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def velocity(north: float, east: float = 0.0) -> m.SetPositionTargetLocalNed:
    return local_target(VELOCITY, velocity=(north, east))
