"""Bodies with faults."""

from rover_sim.body import Body, BodyState, Pose
from tests.kit.world import kinematic_body


class Disobedient:
    """A body that moves forward otherwise than it is told; implements ``Body``."""

    def __init__(self, start: Pose) -> None:
        self._body: Body = kinematic_body(start)
        self._wanted = self._given = 0.0
        self._yaw_rate = 0.0

    @property
    def lag(self) -> float:
        """Delay of the wheels behind ``drive``, s."""
        return self._body.lag

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        return self._body.state

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion."""
        self._wanted, self._yaw_rate = forward_speed, yaw_rate

    def advance(self, duration: float) -> None:
        """Move by ``duration`` seconds."""
        self._given = self.follow(duration)
        self._body.drive(self._given, self._yaw_rate)
        self._body.advance(duration)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""

    def follow(self, _duration: float) -> float:
        """Return the speed after so many seconds, m/s."""
        return self._wanted


class WeakBrakes(Disobedient):
    """A body that decelerates at most at ``braking`` m/s²."""

    def __init__(self, start: Pose, *, braking: float) -> None:
        super().__init__(start)
        self._braking = braking

    def follow(self, duration: float) -> float:
        least = self._braking * duration
        before, wanted = self._given, self._wanted
        if before > 0:
            return max(wanted, before - least)
        return min(wanted, before + least) if before < 0 else wanted


class Sticky(Disobedient):
    """A body that needs a least speed to start, and rolls on freely.

    A demand below ``least`` m/s does not move it. On zero it decelerates at ``rolling`` m/s².
    """

    def __init__(self, start: Pose, *, least: float, rolling: float) -> None:
        super().__init__(start)
        self._least, self._rolling = least, rolling

    def follow(self, duration: float) -> float:
        wanted = self._wanted if abs(self._wanted) >= self._least else 0.0
        step = self._rolling * duration
        if abs(wanted) < abs(self._given) or wanted * self._given < 0.0:
            return self._given + max(-step, min(step, wanted - self._given))
        return wanted
