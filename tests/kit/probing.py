"""A probe and a simulated rover on one net, in virtual time, with invariants checked each step."""

from collections.abc import Callable
from math import hypot, isfinite

from mav_tasks.links.memory import MemoryLink, MemoryNet
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.probe.findings import Drive
from mav_tasks.probe.probe import Options, Probe
from rover_sim.body import Body, Pose
from rover_sim.faults import Faults
from rover_sim.personas import ARDUPILOT, Mode, Persona
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld
from tests.kit.world import PX4_HOLD, kinematic_body

BOOT = 5.0  # s until the start: the rover's estimate has settled
OVER_WITHIN = 120.0  # s
BOX = 1.0  # m from the middle to a side
GUIDED_BEFORE = 0.2  # s for which a setpoint may be in transit after the rover left the mode


class ProbeParty:
    """The probe on its link."""

    def __init__(self, link: MemoryLink, options: Options, *, now: float) -> None:
        self.probe = Probe(options, now=now)
        self._link = link
        self.sent: list[tuple[float, m.Message]] = []
        self._decoder = Decoder()

    def next_deadline(self) -> float | None:
        """Return when the probe is due."""
        return None if self.probe.is_over else self.probe.next_deadline()

    def turn(self, *, now: float) -> None:
        """Read packets, do what is due, send packets."""
        for _, data in self._link.receive(len(self._link.arrived)):
            for packet in split_datagram(data):
                if not self.probe.is_over:
                    self.probe.receive(packet, now=now)
        if not self.probe.is_over and self.probe.next_deadline() <= now:
            self.probe.handle_deadline(now=now)
        for data in self.probe.take_packets():
            for packet in split_datagram(data):
                message = self._decoder.decode(packet)
                assert message is not None
                self.sent.append((now, message))
            self._link.send("rover1", data)


class ProbeWorld(VirtualWorld):
    """One settled rover, and the probe."""

    def __init__(
        self,
        *,
        drive: bool = False,
        speed: float = 0.3,
        persona: Persona = ARDUPILOT,
        body: Callable[[Pose], Body] = kinematic_body,
        start: Pose = Pose(),  # noqa: B008  # frozen
        options: Options | None = None,
    ) -> None:
        super().__init__(MemoryNet())
        self.start = start
        self.rover = make_vehicle(body(start), system_id=1, now=0.0, persona=persona)
        if "COM_OBL_RC_ACT" in self.rover.autopilot.parameters:
            # by default a PX4 rover drives home when setpoints stop; some tests restore that
            self.rover.autopilot.parameters["COM_OBL_RC_ACT"] = PX4_HOLD
        self.join(RoverParty(self.rover, self.net.link("rover1")))
        self.run(BOOT)
        self._stranger = self.net.link("stranger")
        options = options or Options(drive=drive, speed=speed)
        link = self.net.link("probe", peers=("rover1",))
        self.party = ProbeParty(link, options, now=self.now)
        self.farthest = 0.0
        self._looked_at = 0
        self._driven_at = -1.0  # when it was last truly armed and in GUIDED
        self.join(self.party)
        self.watch(self._look)

    @property
    def probe(self) -> Probe:
        """The probe."""
        return self.party.probe

    @property
    def driven(self) -> Drive:
        """The result of driving."""
        assert self.probe.findings.drive is not None
        return self.probe.findings.drive

    def finish(self) -> Probe:
        """Let time pass until the probe is over; return it."""
        assert self.run_until(lambda: self.probe.is_over, within=OVER_WITHIN), repr(self.probe)
        return self.probe

    def until_moving(self) -> None:
        """Let time pass until the rover truly moves."""
        moving = self.run_until(lambda: abs(self.rover.truth.forward_speed) > 0.15, within=60)
        assert moving, repr(self.probe)

    def fault(self, faults: Faults) -> None:
        """Set faults of the rover; ``Faults()`` clears them."""
        self.rover.autopilot.set_faults(faults)

    def somebody_sends(self, message: m.Message, source: Address) -> None:
        """Send a message of another sender to the probe."""
        self._stranger.send("probe", Encoder(source).encode(message))

    def stands(self) -> bool:
        """Return whether the rover truly stands."""
        truth = self.rover.truth
        return abs(truth.forward_speed) < 0.01 and abs(truth.yaw_rate) < 0.01

    def rests(self) -> bool:
        """Return whether the rover stands in HOLD, disarmed."""
        autopilot = self.rover.autopilot
        return self.stands() and autopilot.mode is Mode.HOLD and not autopilot.armed

    def commands(self) -> list[tuple[int, float]]:
        """Return id and first parameter of every sent command."""
        return [
            (message.command, message.param1)
            for _, message in self.party.sent
            if isinstance(message, m.CommandLong)
        ]

    def setpoints(self) -> list[tuple[float, m.SetPositionTargetLocalNed]]:
        """Return every sent setpoint with its time."""
        return [
            (at, message)
            for at, message in self.party.sent
            if isinstance(message, m.SetPositionTargetLocalNed)
        ]

    def _look(self, now: float) -> None:
        """Check the box, and setpoints: finite, and moving only if armed in GUIDED."""
        autopilot, truth = self.rover.autopilot, self.rover.truth
        if autopilot.armed and autopilot.mode is Mode.GUIDED:
            self._driven_at = now
        for at, message in self.party.sent[self._looked_at :]:
            if not isinstance(message, m.SetPositionTargetLocalNed):
                continue
            values = (message.vx, message.vy, message.vz, message.yaw_rate)
            assert all(map(isfinite, values)), message
            assert not any(values) or at - self._driven_at <= GUIDED_BEFORE, f"{at}: {message}"
        self._looked_at = len(self.party.sent)
        self.farthest = max(
            self.farthest, abs(truth.north - self.start.north), abs(truth.east - self.start.east)
        )
        assert hypot(truth.north - self.start.north, truth.east - self.start.east) < BOX * 1.5


def is_moving(message: m.SetPositionTargetLocalNed) -> bool:
    """Return whether a setpoint demands motion."""
    return any(abs(v) >= 0.002 for v in (message.vx, message.vy, message.vz, message.yaw_rate))
