"""A body that a tester can carry and turn."""

from math import cos, sin

from rover_sim.body import Body, BodyState, Pose, wrap_angle


class BodyByHand:
    """A body that can be moved from outside; implements ``Body``.

    The ground is the same everywhere, so moving a rover means moving the ground's frame under it.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
        self._offset: Pose | None = None  # of the body's frame; None: not moved yet

    @property
    def lag(self) -> float:
        """Delay of the wheels behind ``drive``, s."""
        return self._body.lag

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance`` or ``place``."""
        state, offset = self._body.state, self._offset
        if offset is None:
            return state
        north, east = turned(state.north, state.east, offset.yaw)
        return state._replace(
            north=offset.north + north,
            east=offset.east + east,
            yaw=wrap_angle(offset.yaw + state.yaw),
        )

    def place(self, pose: Pose) -> None:
        """Put the rover down at this pose. It keeps its motion relative to its heading."""
        state = self._body.state
        turn = wrap_angle(pose.yaw - state.yaw)
        north, east = turned(state.north, state.east, turn)
        self._offset = Pose(north=pose.north - north, east=pose.east - east, yaw=turn)

    def push(self, forward: float, right: float, turn: float) -> None:
        """Move the rover by metres along its own axes, then turn it clockwise by radians."""
        state = self.state
        north, east = turned(forward, right, state.yaw)
        self.place(Pose(state.north + north, state.east + east, state.yaw + turn))

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion, kept until the next call."""
        self._body.drive(forward_speed, yaw_rate)

    def advance(self, duration: float) -> None:
        """Step the physics by ``duration`` seconds."""
        self._body.advance(duration)

    def close(self) -> None:
        """Release the body's resources."""
        self._body.close()


def turned(north: float, east: float, angle: float) -> tuple[float, float]:
    """Return the vector (north, east), turned clockwise by ``angle`` (rad)."""
    return north * cos(angle) - east * sin(angle), north * sin(angle) + east * cos(angle)
