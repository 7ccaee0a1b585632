"""A body with car-like steering, and a rover with this body that follows tasks' demands."""

from collections import deque
from dataclasses import replace
from math import cos, exp, sin

from mav_tasks.settings import Turning
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity, wrap
from mav_tasks.tasks.task import Frame
from mav_tasks.tasks.task import Pose as TaskPose
from mav_tasks.tasks.view import Demand, DemandKind, VehicleView
from rover_sim.body import BodyState, Pose, wrap_angle
from tests.unit.tasks.samples import idle_vehicle, ours


class Car:
    """A body with a steered axle: it turns only while it rolls; implements ``Body``.

    ``radius`` is its least turning radius in m. ``share`` is the reached fraction of the demanded
    curvature: half with ArduPilot's default gains (4.6.3, SITL).
    """

    STEP = 0.0125  # s, at most
    PUSH = 3.0  # m/s²
    ENGINE_LAG, STEERING_LAG = 0.1, 0.2  # s
    STANDS = 0.05  # m/s; below it, the wheel angle is not computed from the yaw rate

    def __init__(self, start: Pose, *, radius: float, share: float = 1.0) -> None:
        self._most = 1 / radius
        self._share = share
        self._speed = self._curvature = 0.0
        self._wanted = self._wanted_rate = 0.0
        self._time, self._pose = 0.0, start

    @property
    def lag(self) -> float:
        """Delay of the engine behind ``drive``, s."""
        return self.ENGINE_LAG

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        pose, speed = self._pose, self._speed
        rate = self._curvature * speed
        return BodyState(
            self._time, pose.north, pose.east, 0.0, pose.yaw, 0.0, 0.0, speed, 0.0, rate
        )

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion."""
        self._wanted, self._wanted_rate = forward_speed, yaw_rate

    def advance(self, duration: float) -> None:
        """Move by ``duration`` seconds."""
        left = duration
        while left > 1e-9:
            seconds = min(self.STEP, left)
            self._step(seconds)
            left -= seconds

    def shift(self, *, east: float) -> None:
        """Move the body east by metres."""
        self._pose = replace(self._pose, east=self._pose.east + east)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""

    def _step(self, seconds: float) -> None:
        change = (self._wanted - self._speed) * (1 - exp(-seconds / self.ENGINE_LAG))
        push = self.PUSH * seconds
        self._speed += max(-push, min(push, change))
        if abs(self._wanted - self._speed) < 1e-3:
            self._speed = self._wanted
        if abs(self._speed) > self.STANDS:
            wanted = self._share * self._wanted_rate / self._speed
            wanted = max(-self._most, min(self._most, wanted))
            self._curvature += (wanted - self._curvature) * (1 - exp(-seconds / self.STEERING_LAG))
        way = self._speed * seconds
        turned = self._curvature * way
        middle = self._pose.yaw + turned / 2
        self._pose = Pose(
            self._pose.north + way * cos(middle),
            self._pose.east + way * sin(middle),
            wrap_angle(self._pose.yaw + turned),
        )
        self._time += seconds


class CarRover:
    """A car driven by yaw rate or, if it does not honour one, by course like PX4's."""

    STANDS = 0.01  # m/s
    YAW_GAIN = 2.0  # 1/s, yaw rate per heading error, if driven by course

    def __init__(
        self,
        pose: TaskPose,
        *,
        radius: float,
        share: float = 1.0,
        honours_yaw_rate: bool = True,
        frame: Frame | None = None,
    ) -> None:
        self.body = Car(Pose(pose.north, pose.east, pose.yaw), radius=radius, share=share)
        self.frame = frame
        self.is_ours = False
        self.known_radius = radius
        self._turning = Turning.STEERED
        self._honours_yaw_rate = honours_yaw_rate
        self.overspeed = 1.0  # times the demanded speed
        #: latest measurements, oldest first; the server sees the oldest
        self.measured: deque[Motion] = deque(maxlen=1)

    @property
    def pose(self) -> TaskPose:
        """True pose."""
        state = self.body.state
        return TaskPose(state.north, state.east, state.yaw)

    def turns_on_spot(self) -> None:
        """Make the server believe that the rover turns on the spot."""
        self._turning = Turning.ON_SPOT

    def view(self, now: float) -> VehicleView:
        """Return the server's view of the rover."""
        made = ours if self.is_ours else idle_vehicle
        state = self.body.state
        self.measured.append(Motion(self.pose, state.forward_speed, 0.0, state.yaw_rate, now))
        return replace(
            made(at=now),
            motion=self.measured[0],
            still=abs(state.forward_speed) < self.STANDS,
            frame=self.frame,
            honours_yaw_rate=self._honours_yaw_rate,
            turning=self._turning,
            turning_radius=self.known_radius,
        )

    def follow(self, demand: Demand, *, seconds: float) -> None:
        """Follow a demand for ``seconds``."""
        if demand.kind in (DemandKind.TAKE, DemandKind.DRIVE):
            self.is_ours = True
        elif demand.kind in (DemandKind.HAND_BACK, DemandKind.STOP, DemandKind.HALT):
            self.is_ours = False
        velocity = demand.velocity if self.is_ours else ZERO
        self.body.drive(self.overspeed * velocity.forward, self._rate_of(velocity))
        self.body.advance(seconds)

    def _rate_of(self, velocity: Velocity) -> float:
        if self._honours_yaw_rate:
            assert velocity.course is None
            return velocity.yaw_rate
        assert velocity.forward >= 0.0
        assert velocity.yaw_rate == 0.0
        if velocity.course is None:
            return 0.0
        return self.YAW_GAIN * wrap(velocity.course - self.pose.yaw)
