"""The fence: allowed places, allowed straight ways, and the room ahead of a vehicle.

A vehicle must be outside every exclusion zone. If there are inclusion zones, it must be inside all
zones of at least one group (common.xml, MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION and its kin).
The boundary of a zone and a millimetre to either side are forbidden: a vehicle has a size. Edges
are straight in the local frame. Other modules decide what happens to a vehicle in a forbidden
place.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import Enum, auto
from itertools import pairwise
from math import cos, hypot, inf, sin, sqrt

from mav_tasks.tasks.frames import to_local
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace
from mav_tasks.tasks.task import Pose

EDGE = 0.001  # m to either side of a boundary that count as boundary
MIN_CORNERS = 3
MIN_WIDTH = 0.02  # m; less may be only the rounding of a place's integers, 11 mm


@dataclass(frozen=True, slots=True)
class Polygon:
    """A zone by its corners in order, either way round; the last joins the first.

    The even-odd rule holds where it crosses itself. ``group`` counts for inclusion zones only.
    """

    corners: tuple[GlobalPlace, ...]
    is_inclusion: bool
    group: int = 0


@dataclass(frozen=True, slots=True)
class Circle:
    """A round zone; ``radius`` in metres. ``group`` counts for inclusion zones only."""

    centre: GlobalPlace
    radius: float
    is_inclusion: bool
    group: int = 0


Zone = Polygon | Circle


@dataclass(frozen=True, slots=True)
class Fence:
    """All zones of a vehicle; without zones it may be everywhere."""

    zones: tuple[Zone, ...] = ()


def check(fence: Fence) -> str | None:
    """Return in words what is wrong with a fence, or None.

    A polygon has no area if all its corners are on one line. It may cross itself.
    """
    for zone in fence.zones:
        match zone:
            case Polygon(corners=corners):
                if len(corners) < MIN_CORNERS:
                    return f"a polygon needs at least {MIN_CORNERS} corners, not {len(corners)}"
                if not _has_area(corners):
                    return "a polygon has no area"
            case Circle(radius=radius):
                if not 0 < radius < inf:
                    return f"a circle needs a positive radius, not {radius:g} m"
    return None


def _has_area(corners: tuple[GlobalPlace, ...]) -> bool:
    places = [to_local(corner, corners[0]) for corner in corners]
    far = max(places, key=lambda place: hypot(place.north, place.east))
    area = MIN_WIDTH * hypot(far.north, far.east)
    return any(abs(p.north * far.east - p.east * far.north) > area for p in places)


class LocalFence:
    """A fence in the coordinates of one local frame, computed once for many queries.

    ``check`` must have found nothing wrong with ``fence``.
    """

    def __init__(self, fence: Fence, origin: GlobalPlace) -> None:
        self._exclusions: list[_LocalZone] = []
        groups: dict[int, list[_LocalZone]] = {}
        for zone in fence.zones:
            kin = groups.setdefault(zone.group, []) if zone.is_inclusion else self._exclusions
            kin.append(_local(zone, origin))
        self._groups = list(groups.values())
        self._zones = [zone for kin in (self._exclusions, *self._groups) for zone in kin]

    def allows(self, place: LocalPlace) -> bool:
        """Return whether the vehicle may be at a place."""
        north, east = place.north, place.east
        if any(zone.side(north, east) is not _Side.OUTSIDE for zone in self._exclusions):
            return False
        return not self._groups or any(
            all(zone.side(north, east) is _Side.INSIDE for zone in group) for group in self._groups
        )

    def allows_way(self, start: LocalPlace, end: LocalPlace) -> bool:
        """Return whether every place of the straight way is allowed, including both ends."""
        return self.first_forbidden(start, end) is None

    def first_forbidden(self, start: LocalPlace, end: LocalPlace) -> float | None:
        """Return how far along a straight way its first forbidden place is, in m, or None."""
        walk = self._walk(_Way(start, end))
        return next((along for along, is_allowed in walk if not is_allowed), None)

    def escapes(self, start: LocalPlace, end: LocalPlace) -> bool:
        """Return whether the straight way leads back from a forbidden place.

        It must change from forbidden to allowed exactly once, and never from allowed to forbidden.
        """
        states = [is_allowed for _, is_allowed in self._walk(_Way(start, end))]
        return states[0] < states[-1] and states == sorted(states)

    def room(self, pose: Pose, *, forward: bool, limit: float) -> float:
        """Return the metres straight ahead, or straight back, to the first forbidden place.

        Return ``limit``, finite and not negative, if there is none before; 0.0 if the pose itself
        is forbidden.
        """
        reach = limit if forward else -limit
        start = LocalPlace(pose.north, pose.east)
        end = LocalPlace(pose.north + reach * cos(pose.yaw), pose.east + reach * sin(pose.yaw))
        along = self.first_forbidden(start, end)
        return limit if along is None else min(along, limit)

    def _walk(self, way: "_Way") -> Iterator[tuple[float, bool]]:
        """Yield (metres along a way, whether its places are allowed from there on), in order.

        All places between two marks are alike, so only the middle is checked.
        """
        yield 0.0, self.allows(way.start)
        marks = (mark for zone in self._zones for mark in zone.marks(way) if 0 < mark < way.length)
        for here, there in pairwise((0.0, *sorted(marks), way.length)):
            yield here, self.allows(way.at((here + there) / 2))
        yield way.length, self.allows(way.end)


_Point = tuple[float, float]  # north and east; LocalPlace is too slow for corners


class _Way:
    """A straight way; ``north`` and ``east`` are its direction, 0 if its length is 0."""

    def __init__(self, start: LocalPlace, end: LocalPlace) -> None:
        self.start = start
        self.end = end
        north, east = end.north - start.north, end.east - start.east
        self.length = hypot(north, east)
        self.north = north / (self.length or 1.0)
        self.east = east / (self.length or 1.0)

    def at(self, along: float) -> LocalPlace:
        north, east = self.start.north + along * self.north, self.start.east + along * self.east
        return LocalPlace(north, east)

    def along(self, place: _Point) -> float:
        """Return how far along the way, or its extension, a place is."""
        north, east = place
        return (north - self.start.north) * self.north + (east - self.start.east) * self.east

    def rights(self, places: Iterable[_Point]) -> list[float]:
        """Return how far each place is to the right of the way or its extension."""
        to_north, to_east = self.north, self.east
        here = self.start.east * to_north - self.start.north * to_east
        return [east * to_north - north * to_east - here for north, east in places]

    def is_near(self, place: _Point) -> bool:
        [right], along = self.rights([place]), self.along(place)
        return hypot(along - max(0.0, min(self.length, along)), right) <= EDGE


class _Side(Enum):
    """Side of a zone's boundary; NEAR: within EDGE of it."""

    INSIDE = auto()
    NEAR = auto()
    OUTSIDE = auto()


# Both kinds of zones have ``side``, which returns the side of a place, and ``marks``, which yields
# the metres along a way where the side may change. Extra marks do no harm. Inside and outside are
# at least 2 mm apart, so that rounding decides nothing: no touched corner, no followed edge.


class _LocalPolygon:
    def __init__(self, polygon: Polygon, origin: GlobalPlace) -> None:
        corners = [to_local(corner, origin) for corner in polygon.corners]
        self._corners = [(corner.north, corner.east) for corner in corners]
        self._ends = list(pairwise((*self._corners, self._corners[0])))
        self._box = _box(corners)
        self._edges = [(*_box(ends), _Way(*ends)) for ends in pairwise((*corners, corners[0]))]

    def side(self, north: float, east: float) -> _Side:
        low_north, high_north, low_east, high_east = self._box
        if not (low_north <= north <= high_north and low_east <= east <= high_east):
            return _Side.OUTSIDE
        is_odd = False  # parity of the edges that a ray to the east crosses
        for low_north, high_north, low_east, high_east, edge in self._edges:
            if not (low_north <= north <= high_north and east <= high_east):
                continue
            if east >= low_east and edge.is_near((north, east)):
                return _Side.NEAR
            # half open: a corner counts once if the ray passes through it, else twice or never
            begin = edge.start
            if (begin.north > north) != (edge.end.north > north):
                is_odd ^= east < begin.east + (north - begin.north) * edge.east / edge.north
        return _Side.INSIDE if is_odd else _Side.OUTSIDE

    def marks(self, way: _Way) -> Iterator[float]:
        rights = way.rights(self._corners)
        for ends, right, end_right in zip(self._ends, rights, rights[1:] + rights[:1], strict=True):
            if (right > EDGE and end_right > EDGE) or (right < -EDGE and end_right < -EDGE):
                continue
            along, end_along = map(way.along, ends)
            if abs(right) < EDGE:  # near the corner, where the boundary is rounded
                half = sqrt((EDGE - right) * (EDGE + right))
                yield from (along - half, along + half)
            if right != end_right:  # near the straight part: the flatter the crossing, the longer
                slope = (end_along - along) / (end_right - right)
                half = EDGE * hypot(1.0, slope)
                yield from (along - right * slope - half, along - right * slope + half)


class _LocalCircle:
    def __init__(self, circle: Circle, origin: GlobalPlace) -> None:
        centre = to_local(circle.centre, origin)
        self._north, self._east = centre.north, centre.east
        self._radius = circle.radius

    def side(self, north: float, east: float) -> _Side:
        inwards = self._radius - hypot(north - self._north, east - self._east)
        if abs(inwards) <= EDGE:
            return _Side.NEAR
        return _Side.INSIDE if inwards > 0 else _Side.OUTSIDE

    def marks(self, way: _Way) -> Iterator[float]:
        centre = (self._north, self._east)
        [right], along = way.rights([centre]), way.along(centre)
        for radius in (self._radius - EDGE, self._radius + EDGE):
            if abs(right) < radius:
                half = sqrt((radius - right) * (radius + right))
                yield from (along - half, along + half)


_LocalZone = _LocalPolygon | _LocalCircle


def _local(zone: Zone, origin: GlobalPlace) -> _LocalZone:
    return _LocalPolygon(zone, origin) if isinstance(zone, Polygon) else _LocalCircle(zone, origin)


def _box(places: Iterable[LocalPlace]) -> tuple[float, float, float, float]:
    """Return the least and greatest north, then east, of these places, widened by EDGE."""
    norths = [place.north for place in places]
    easts = [place.east for place in places]
    return min(norths) - EDGE, max(norths) + EDGE, min(easts) - EDGE, max(easts) + EDGE
