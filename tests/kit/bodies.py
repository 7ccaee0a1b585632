"""Bodies with faults."""

from rover_sim.body import Body, BodyState, Pose
from tests.kit.world import kinematic_body


class WeakBrakes:
    """A body that decelerates at most at ``braking`` m/s²; implements ``Body``."""

    def __init__(self, start: Pose, *, braking: float) -> None:
        self._body: Body = kinematic_body(start)
        self._braking = braking
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
        least = self._braking * duration
        before, wanted = self._given, self._wanted
        if before > 0:
            self._given = max(wanted, before - least)
        elif before < 0:
            self._given = min(wanted, before + least)
        else:
            self._given = wanted
        self._body.drive(self._given, self._yaw_rate)
        self._body.advance(duration)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""


class Sticky:
    """A body that needs a least speed to start, and rolls on freely; implements ``Body``.

    A demand below ``least`` m/s does not move it. On zero it decelerates at ``rolling`` m/s².
    """

    def __init__(self, start: Pose, *, least: float, rolling: float) -> None:
        self._body: Body = kinematic_body(start)
        self._least, self._rolling = least, rolling
        self._wanted = self._given = 0.0
        self._yaw_rate = 0.0

    @property
    def lag(self) -> float:
        """Delay of the wheels behind ``drive``, s."""
        return 0.1

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        return self._body.state

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion."""
        self._wanted, self._yaw_rate = forward_speed, yaw_rate

    def advance(self, duration: float) -> None:
        """Move by ``duration`` seconds."""
        wanted = self._wanted if abs(self._wanted) >= self._least else 0.0
        step = self._rolling * duration
        if abs(wanted) < abs(self._given) or wanted * self._given < 0.0:
            towards = max(-step, min(step, wanted - self._given))
            self._given += towards
        else:
            self._given = wanted
        self._body.drive(self._given, self._yaw_rate)
        self._body.advance(duration)

    def close(self) -> None:
        """Do nothing: the body holds no resources."""
