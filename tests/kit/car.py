"""A body with car-like steering."""

from math import cos, exp, sin

from rover_sim.body import BodyState, Pose, wrap_angle


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
