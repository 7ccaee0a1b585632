"""The fence: allowed places, allowed straight ways, and the room ahead of a vehicle.

A vehicle must be outside every exclusion zone. If there are inclusion zones, it must be inside all
zones of at least one group (common.xml, MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION and its kin).
The boundary of a zone and a millimetre to either side are forbidden: a vehicle has a size. Edges
are straight in the local frame. Other modules decide what happens to a vehicle in a forbidden
place.

Points are complex numbers here: metres north, and imaginary ones east.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, sqrt

from mav_tasks.kinds import GlobalPlace, Pose
from mav_tasks.kinds.path import Spot, moved, point_of
from mav_tasks.tasks.driving.frames import to_local

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
            case Polygon(corners=corners) if len(corners) < MIN_CORNERS:
                return f"a polygon needs at least {MIN_CORNERS} corners, not {len(corners)}"
            case Polygon(corners=corners):
                places = _points(corners, corners[0])
                far = max(places, key=abs)
                if all(abs((p * far.conjugate()).imag) <= MIN_WIDTH * abs(far) for p in places):
                    return "a polygon has no area"
            case Circle(radius=radius) if not 0 < radius < inf:
                return f"a circle needs a positive radius, not {radius:g} m"
    return None


class LocalFence:
    """A fence in the coordinates of one local frame, computed once for many queries.

    ``check`` must have found nothing wrong with ``fence``.
    """

    def __init__(self, fence: Fence, origin: GlobalPlace) -> None:
        self._exclusions: list[_LocalPolygon | _LocalCircle] = []
        groups: dict[int, list[_LocalPolygon | _LocalCircle]] = {}
        for zone in fence.zones:
            kin = groups.setdefault(zone.group, []) if zone.is_inclusion else self._exclusions
            if isinstance(zone, Polygon):
                kin.append(_LocalPolygon(_points(zone.corners, origin)))
            else:
                kin.append(_LocalCircle(point_of(to_local(zone.centre, origin)), zone.radius))
        self._groups = list(groups.values())
        self._zones = [zone for kin in (self._exclusions, *self._groups) for zone in kin]

    def allows(self, place: Spot) -> bool:
        """Return whether the vehicle may be at a place."""
        return self._allows(point_of(place))

    def allows_way(self, start: Spot, end: Spot) -> bool:
        """Return whether every place of the straight way is allowed, including both ends."""
        return self.first_forbidden(start, end) is None

    def first_forbidden(self, start: Spot, end: Spot) -> float | None:
        """Return how far along a straight way its first forbidden place is, in m, or None."""
        return next((along for along, allowed in self._walk(start, end) if not allowed), None)

    def escapes(self, start: Spot, end: Spot) -> bool:
        """Return whether the straight way leads back from a forbidden place.

        It must change from forbidden to allowed exactly once, and never from allowed to forbidden.
        """
        states = [is_allowed for _, is_allowed in self._walk(start, end)]
        return states[0] < states[-1] and states == sorted(states)

    def room(self, pose: Pose, *, forward: bool, limit: float) -> float:
        """Return the metres straight ahead, or straight back, to the first forbidden place.

        Return ``limit``, finite and not negative, if there is none before; 0.0 if the pose itself
        is forbidden.
        """
        along = self.first_forbidden(pose, moved(pose, 0.0, limit if forward else -limit))
        return limit if along is None else min(along, limit)

    def _allows(self, point: complex) -> bool:
        if any(zone.inwards(point) >= 0 for zone in self._exclusions):
            return False
        return not self._groups or any(
            all(zone.inwards(point) > 0 for zone in group) for group in self._groups
        )

    def _walk(self, start: Spot, end: Spot) -> Iterator[tuple[float, bool]]:
        """Yield (metres along a way, whether its places are allowed from there on), in order.

        All places between two marks are alike, so only the middle is checked.
        """
        way = _Way(point_of(start), point_of(end))
        yield 0.0, self._allows(way.start)
        marks = (mark for zone in self._zones for mark in zone.marks(way) if 0 < mark < way.length)
        for here, there in pairwise((0.0, *sorted(marks), way.length)):
            yield here, self._allows(way.start + (here + there) / 2 * way.ahead)
        yield way.length, self._allows(way.end)


class _Way:
    """A straight way; ``ahead`` is its direction, 0 if its length is 0."""

    def __init__(self, start: complex, end: complex) -> None:
        self.start, self.end, way = start, end, end - start
        self.length = hypot(way.real, way.imag)
        self.ahead = way / (self.length or 1.0)

    def seen(self, points: Iterable[complex]) -> list[complex]:
        """Return points as seen from the start: metres ahead, and imaginary ones to the right."""
        start, back = self.start, self.ahead.conjugate()
        return [(point - start) * back for point in points]


def _crossed(centre: complex, radius: float) -> Iterable[float]:
    """Return how far along a way, or its extension, a circle that it sees is entered and left."""
    along, right = centre.real, centre.imag
    if abs(right) >= radius:
        return ()
    half = sqrt((radius - right) * (radius + right))
    return along - half, along + half


# Both kinds of zones have ``inwards``, which is positive inside, negative outside, and 0 within
# EDGE of the boundary; and ``marks``, which yields the metres along a way where that may change.
# Extra marks do no harm. Inside and outside are at least 2 mm apart, so that rounding decides
# nothing: no touched corner, no followed edge.


class _LocalPolygon:
    def __init__(self, corners: list[complex]) -> None:
        self._corners = corners
        self._box = _box(corners)
        ends = pairwise((*corners, corners[0]))
        self._edges = [(*_box(edge), _Way(*edge)) for edge in ends]

    def inwards(self, point: complex) -> float:
        north, east = point.real, point.imag
        low_north, high_north, low_east, high_east = self._box
        if not (low_north <= north <= high_north and low_east <= east <= high_east):
            return -1
        side = -1  # it changes with each edge that a ray to the east crosses
        for low_north, high_north, low_east, high_east, edge in self._edges:
            if not (low_north <= north <= high_north and east <= high_east):
                continue
            if east >= low_east:
                [seen] = edge.seen([point])
                if hypot(seen.real - max(0.0, min(edge.length, seen.real)), seen.imag) <= EDGE:
                    return 0
            # half open: a corner counts once if the ray passes through it, else twice or never
            begin = edge.start
            if (begin.real > north) != (edge.end.real > north) and (
                east < begin.imag + (north - begin.real) * edge.ahead.imag / edge.ahead.real
            ):
                side = -side
        return side

    def marks(self, way: _Way) -> Iterator[float]:
        seen = way.seen(self._corners)
        for here, there in pairwise((*seen, seen[0])):
            right, end_right = here.imag, there.imag
            if (right > EDGE and end_right > EDGE) or (right < -EDGE and end_right < -EDGE):
                continue
            yield from _crossed(here, EDGE)  # near the corner, where the boundary is rounded
            if right != end_right:  # near the straight part: the flatter the crossing, the longer
                slope = (there.real - here.real) / (end_right - right)
                middle, half = here.real - right * slope, EDGE * hypot(1.0, slope)
                yield from (middle - half, middle + half)


class _LocalCircle:
    def __init__(self, centre: complex, radius: float) -> None:
        self._centre, self._radius = centre, radius

    def inwards(self, point: complex) -> float:
        away = point - self._centre
        inwards = self._radius - hypot(away.real, away.imag)
        return 0.0 if abs(inwards) <= EDGE else inwards

    def marks(self, way: _Way) -> Iterator[float]:
        [centre] = way.seen([self._centre])
        for radius in (self._radius - EDGE, self._radius + EDGE):
            yield from _crossed(centre, radius)


def _points(places: Iterable[GlobalPlace], origin: GlobalPlace) -> list[complex]:
    return [point_of(to_local(place, origin)) for place in places]


def _box(points: Iterable[complex]) -> tuple[float, float, float, float]:
    """Return the least and greatest north, then east, of these points, widened by EDGE."""
    norths = [point.real for point in points]
    easts = [point.imag for point in points]
    return min(norths) - EDGE, max(norths) + EDGE, min(easts) - EDGE, max(easts) + EDGE
