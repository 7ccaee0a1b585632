"""The vehicle body that an autopilot drives: the seam between flight stack and physics.

A body knows wheels and ground, but no MAVLink, modes or origins.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol


class BodyState(NamedTuple):
    """True position and motion of a body, not an estimate. SI units, NED axes.

    Positions are relative to the ground frame's zero point, on the ground; ``down`` is 0 at rest.
    """

    time: float  # s of simulated time since the body was made
    north: float
    east: float
    down: float
    yaw: float  # rad, clockwise from north, -pi..pi
    pitch: float  # rad, nose up is positive
    roll: float  # rad, right side down is positive
    forward_speed: float  # m/s along the heading
    lateral_speed: float  # m/s to the right
    yaw_rate: float  # rad/s, clockwise


@dataclass(frozen=True, slots=True)
class Pose:
    """Start pose of a body: on the ground, at rest."""

    north: float = 0.0
    east: float = 0.0
    yaw: float = 0.0  # rad, clockwise from north


class Body(Protocol):
    """A rover on wheels. One process may hold many; each is stepped separately."""

    @property
    def lag(self) -> float:
        """Delay of the wheels behind ``drive``, s."""
        ...

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        ...

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand wheel speeds for this motion (m/s, rad/s clockwise), kept until the next call.

        The wheels would make this motion without slip; the autopilot closes the loop.
        """
        ...

    def advance(self, duration: float) -> None:
        """Step the physics by ``duration`` seconds."""
        ...

    def close(self) -> None:
        """Release the body's resources; it cannot be used afterwards."""
        ...


def wrap_angle(angle: float) -> float:
    """Return the same angle within -pi..pi."""
    return math.remainder(angle, math.tau)


def turned(north: float, east: float, angle: float) -> tuple[float, float]:
    """Return the vector (north, east), turned clockwise by ``angle`` (rad)."""
    cos, sin = math.cos(angle), math.sin(angle)
    return north * cos - east * sin, north * sin + east * cos
