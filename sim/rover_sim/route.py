"""Places to drive to, in order: AUTO's mission or built-in square, RTL's home."""

from collections.abc import Callable
from typing import NamedTuple

from rover_sim.estimate import Estimate
from rover_sim.setpoints import Destination
from rover_sim.steering import STOP, Demand

TRACK_SIDE = 4.0  # m, of the square that AUTO drives when no mission is stored


#: returns the demand to drive to a place with a speed limit (m/s); None on arrival
Steer = Callable[[Estimate, Destination, float], Demand | None]


class Waypoint(NamedTuple):
    """A place, with the sequence number of its mission item, if it has one."""

    seq: int | None
    place: Destination


class Route:
    """Progress along waypoints. ``loop`` starts again after the last one."""

    def __init__(self, waypoints: tuple[Waypoint, ...], *, loop: bool) -> None:
        self._waypoints = waypoints
        self._loop = loop
        self._index = 0

    def __repr__(self) -> str:
        return f"Route({self._index} of {len(self._waypoints)})"

    @property
    def next(self) -> Waypoint | None:
        """The waypoint that the rover drives to; None at the end."""
        return self._waypoints[self._index] if self._index < len(self._waypoints) else None

    def skip_to(self, seq: int) -> None:
        """Continue at the first waypoint at or after a mission item."""
        numbers = [waypoint.seq or 0 for waypoint in self._waypoints]
        self._index = next((i for i, n in enumerate(numbers) if n >= seq), len(numbers))

    def demand(
        self, estimate: Estimate, speed_limit: float, steer: Steer
    ) -> tuple[Demand, Waypoint | None]:
        """Return the demand, and the waypoint that was just reached, if any."""
        waypoint = self.next
        if waypoint is None:
            return STOP, None
        demand = steer(estimate, waypoint.place, speed_limit)
        if demand is not None:
            return demand, None
        self._index += 1
        if self._loop:
            self._index %= len(self._waypoints)
        return STOP, waypoint


def square_around(home: Destination) -> Route:
    """Return the built-in track: an endless square with one corner at home."""
    north, east = home
    side = TRACK_SIDE
    corners = ((side, 0.0), (side, side), (0.0, side), (0.0, 0.0))
    return Route(
        tuple(Waypoint(None, Destination(north + dn, east + de)) for dn, de in corners), loop=True
    )
