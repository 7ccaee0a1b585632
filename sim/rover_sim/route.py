"""Places to drive to, in order: AUTO's mission or built-in square, RTL's home."""

from dataclasses import dataclass
from typing import NamedTuple

from rover_sim.setpoints import Destination

TRACK_SIDE = 4.0  # m, of the square that AUTO drives when no mission is stored


class Waypoint(NamedTuple):
    """A place, with the sequence number of its mission item, if it has one."""

    seq: int | None
    place: Destination


@dataclass(slots=True)
class Route:
    """Progress along waypoints. ``loop`` starts again after the last one."""

    waypoints: tuple[Waypoint, ...]
    loop: bool = False
    index: int = 0

    @property
    def next(self) -> Waypoint | None:
        """The waypoint that the rover drives to; None at the end."""
        return self.waypoints[self.index] if self.index < len(self.waypoints) else None

    def advance(self) -> None:
        """Go on to the following waypoint."""
        self.index += 1
        if self.loop:
            self.index %= len(self.waypoints)

    def skip_to(self, seq: int) -> None:
        """Continue at the first waypoint at or after a mission item."""
        numbers = [waypoint.seq or 0 for waypoint in self.waypoints]
        self.index = next((i for i, n in enumerate(numbers) if n >= seq), len(numbers))


def square_around(home: Destination) -> Route:
    """Return the built-in track: an endless square with one corner at home."""
    corners = ((TRACK_SIDE, 0.0), (TRACK_SIDE, TRACK_SIDE), (0.0, TRACK_SIDE), (0.0, 0.0))
    places = (Destination(home.north + dn, home.east + de) for dn, de in corners)
    return Route(tuple(Waypoint(None, place) for place in places), loop=True)
