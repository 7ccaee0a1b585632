"""Poses of a rover over time, true or reported, and what follows from them."""

from bisect import bisect_left
from dataclasses import dataclass
from math import hypot, inf, remainder, tau

WINDOW = 0.5  # s; a displacement over this time gives a speed without the noise of one sample
STANDS = 0.05  # m/s; the speed that real rovers report at rest wanders by 0.03 m/s (traces)
TURNS = 0.03  # rad/s


@dataclass(frozen=True, slots=True)
class Place:
    """A pose at a time: s, m, rad clockwise from north; m/s ahead and rad/s if they are known."""

    time: float
    north: float
    east: float
    yaw: float = 0.0
    speed: float = 0.0
    yaw_rate: float = 0.0

    def apart(self, other: "Place") -> float:
        """Return the distance to another place, m."""
        return hypot(self.north - other.north, self.east - other.east)


class Track:
    """Places in order of time."""

    def __init__(self) -> None:
        self.places: list[Place] = []

    def __len__(self) -> int:
        return len(self.places)

    def add(self, place: Place) -> None:
        """Add a place; ignore one that is not later than the last."""
        if not self.places or place.time > self.places[-1].time:
            self.places.append(place)

    @property
    def last(self) -> Place:
        """The latest place. Raise IndexError if there is none."""
        return self.places[-1]

    def since(self, time: float) -> list[Place]:
        """Return the places since ``time``, and the one before."""
        return self.places[max(0, bisect_left(self.places, time, key=_time) - 1) :]

    def between(self, begin: float, end: float) -> list[Place]:
        """Return the places from one time to another, s."""
        first = bisect_left(self.places, begin, key=_time)
        return self.places[first : bisect_left(self.places, end, key=_time)]

    def speed(self) -> float:
        """Return the speed from the displacement over the last WINDOW, m/s."""
        return self._motion()[0]

    def stands(self, *, window: float = WINDOW) -> bool:
        """Return whether the rover has neither moved nor turned over the last ``window``, s."""
        speed, turning = self._motion(window)
        return speed < STANDS and turning < TURNS

    def stood_after(self, time: float) -> float | None:
        """Return the seconds from ``time`` until the rover stood for good; None if it moves."""
        if not self.stands():
            return None
        places, moving, first = self.since(time), time, 0
        for place in places:
            while places[first].time < place.time - WINDOW:
                first += 1
            seconds = max(place.time - places[first].time, 1e-6)
            if seconds > WINDOW / 2 and place.apart(places[first]) / seconds >= STANDS:
                moving = max(moving, (place.time + places[first].time) / 2)
        return moving - time

    def travelled(self, time: float) -> float:
        """Return how far it has been from its place at ``time``, m, also if it came back."""
        places = self.between(time, inf)
        return max((place.apart(places[0]) for place in places), default=0.0)

    def _motion(self, window: float = WINDOW) -> tuple[float, float]:
        """Return speed and turning over the last ``window``, m/s and rad/s."""
        first = self.since(self.last.time - window)[0]
        seconds = max(self.last.time - first.time, 1e-6)
        turned = abs(remainder(self.last.yaw - first.yaw, tau))
        return self.last.apart(first) / seconds, turned / seconds


def _time(place: Place) -> float:
    return place.time
