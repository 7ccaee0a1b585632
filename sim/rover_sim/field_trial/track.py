"""Poses of the rover over time, true or reported."""

from collections import deque
from dataclasses import dataclass
from math import hypot, remainder, tau

KEPT = 20_000  # poses; 400 s at 50 Hz
WINDOW = 0.5  # s; a displacement over this time gives a speed without the noise of one sample
STANDS = 0.05  # m/s; the speed that real rovers report at rest wanders by 0.03 m/s (traces)
TURNS = 0.03  # rad/s


@dataclass(frozen=True, slots=True)
class Place:
    """A pose at a time: s, m, rad clockwise from north."""

    time: float
    north: float
    east: float
    yaw: float

    def apart(self, other: "Place") -> float:
        """Return the distance to another place, m."""
        return hypot(self.north - other.north, self.east - other.east)

    def moved(self, north: float, east: float) -> "Place":
        """Return the place at this offset, m."""
        return Place(self.time, self.north + north, self.east + east, self.yaw)


class Track:
    """Poses in order of time."""

    def __init__(self) -> None:
        self._places: deque[Place] = deque(maxlen=KEPT)

    def __len__(self) -> int:
        return len(self._places)

    def add(self, place: Place) -> None:
        """Add a place; ignore one that is not later than the last."""
        if not self._places or place.time > self._places[-1].time:
            self._places.append(place)

    @property
    def last(self) -> Place:
        """The latest place. Raise IndexError if there is none."""
        return self._places[-1]

    def since(self, time: float) -> list[Place]:
        """Return the places since ``time``, and the one before."""
        found: list[Place] = []
        for place in reversed(self._places):
            found.append(place)
            if place.time < time:
                break
        return found[::-1]

    def speed(self, *, window: float = WINDOW) -> float:
        """Return the speed from the displacement over the last ``window``, m/s."""
        places = self.since(self.last.time - window)
        first, last = places[0], places[-1]
        return last.apart(first) / max(last.time - first.time, 1e-6)

    def stands(self, *, window: float = WINDOW) -> bool:
        """Return whether the rover has neither moved nor turned over the last ``window``."""
        places = self.since(self.last.time - window)
        first, last = places[0], places[-1]
        seconds = max(last.time - first.time, 1e-6)
        turned = abs(remainder(last.yaw - first.yaw, tau)) / seconds
        return last.apart(first) / seconds < STANDS and turned < TURNS

    def stood_after(self, time: float, *, window: float = WINDOW) -> float | None:
        """Return the seconds from ``time`` until the rover stood for good; None if it moves."""
        places = self.since(time)
        if not self.stands(window=window):
            return None
        moving = time
        first = 0
        for place in places:
            while places[first].time < place.time - window:
                first += 1
            seconds = max(place.time - places[first].time, 1e-6)
            if seconds > window / 2 and place.apart(places[first]) / seconds >= STANDS:
                moving = max(moving, (place.time + places[first].time) / 2)
        return moving - time

    def travelled(self, time: float) -> float:
        """Return the distance between the place at ``time`` and the last one, m."""
        return self.last.apart(self.since(time)[0])
