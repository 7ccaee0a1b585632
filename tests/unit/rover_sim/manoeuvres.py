"""The manoeuvres of the recordings of real autopilots, on a simulated rover in virtual time."""

from dataclasses import dataclass
from math import cos, degrees, hypot, sin

from mav_tasks.mavlink.messages import Message
from rover_sim.body import BodyState, wrap_angle
from rover_sim.frames import Frame
from rover_sim.personas import ARDUPILOT, PX4
from rover_sim.realism import Realism
from tests.unit.rover_sim.rig import Px4Rig, Rig, body_velocity, heartbeat, velocity

LOOK = 0.02  # s between two looks at the truth
STANDS = 0.03  # m/s, as in the recordings' figures


def ardupilot(frame: Frame, realism: Realism | None = None) -> Rig:
    """Return an ArduPilot rover, armed in GUIDED."""
    rig = Rig(persona=ARDUPILOT.on(frame), realism=realism)
    rig.ready_to_drive()
    return rig


def px4(frame: Frame, realism: Realism | None = None) -> Px4Rig:
    """Return a PX4 rover that points north, armed in OFFBOARD on zeros."""
    rig = Px4Rig(persona=PX4.on(frame), realism=realism)
    rig.ready_to_drive()
    return rig


def ahead(rig: Rig, speed: float) -> Message:
    """Return the setpoint of the recordings: the speed along its heading."""
    if isinstance(rig, Px4Rig):
        yaw = rig.truth.yaw
        return velocity(speed * cos(yaw), speed * sin(yaw))
    return body_velocity(speed)


@dataclass
class Run:
    """What the truth was from the beginning of a manoeuvre, every 0.02 s."""

    times: list[float]
    states: list[BodyState]

    def reached(self, speed: float) -> float:
        """Return after how many seconds it was first as fast."""
        pairs = zip(self.times, self.states, strict=True)
        return next((t for t, s in pairs if s.forward_speed >= speed), float("inf"))

    @property
    def speeds(self) -> list[float]:
        return [state.forward_speed for state in self.states]

    @property
    def peak(self) -> float:
        return max(self.speeds, key=abs)

    def steady(self, part: float = 0.4) -> float:
        """Return the mean speed of the last part of the run."""
        last = self.speeds[-int(part * len(self.speeds)) :]
        return sum(last) / len(last)

    @property
    def stood_after(self) -> tuple[float, float]:
        """Return s and m until it stood for 0.2 s."""
        way, previous, count = 0.0, self.states[0], 0
        for time, state in zip(self.times, self.states, strict=True):
            way += hypot(state.north - previous.north, state.east - previous.east)
            previous = state
            count = count + 1 if abs(state.forward_speed) < STANDS else 0
            if count == 10:
                return time - 9 * LOOK, way
        return float("inf"), way

    @property
    def way(self) -> float:
        """Return how many metres it drove."""
        pairs = zip(self.states, self.states[1:], strict=False)
        return sum(hypot(b.north - a.north, b.east - a.east) for a, b in pairs)

    @property
    def turned(self) -> float:
        """Return by how many degrees it turned, clockwise, whole turns counted."""
        pairs = zip(self.states, self.states[1:], strict=False)
        return degrees(sum(wrap_angle(b.yaw - a.yaw) for a, b in pairs))

    @property
    def peak_rate(self) -> float:
        """Return its fastest turn, deg/s."""
        return degrees(max((state.yaw_rate for state in self.states), key=abs))


def record(rig: Rig, seconds: float, stream: Message | None = None) -> Run:
    """Let time pass and look at the truth all the while."""
    run = Run([0.0], [rig.truth])
    next_send = next_heartbeat = 0.0
    while run.times[-1] < seconds:
        if run.times[-1] >= next_heartbeat:
            rig.send(heartbeat())
            next_heartbeat += 1.0
        if stream is not None and run.times[-1] >= next_send - 1e-9:
            rig.send(stream)
            next_send += 0.05
        rig.run(LOOK)
        run.times.append(run.times[-1] + LOOK)
        run.states.append(rig.truth)
    return run
