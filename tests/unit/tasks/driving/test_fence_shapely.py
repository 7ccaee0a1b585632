"""Random fences, goals and straight ways: the verdict is that of a library of its own, shapely."""

from collections import Counter
from math import cos, pi, sin
from random import Random

import pytest
import shapely
from shapely.geometry import LineString, Point
from shapely.geometry import Polygon as Shape

from mav_tasks.tasks.driving.fence import Circle, Fence, LocalFence, Polygon, Zone
from mav_tasks.tasks.frames import to_global, to_local
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace

ORIGIN = GlobalPlace(473_977_420, 85_455_940)
FENCES, GOALS = 200, 40  # goals of each fence
SURE = 0.003  # m; nearer to a boundary than that the two need not agree
SEGMENTS = 256  # of a quarter of a circle: 0.1 mm off at 5 m


def corner(north: float, east: float) -> GlobalPlace:
    return to_global(LocalPlace(north, east), ORIGIN)


def polygon(random: Random, *, inclusion: bool) -> Polygon:
    """A polygon round its middle, with notches, that does not cross itself."""
    count = random.randrange(3, 12)
    size = random.uniform(8, 25) if inclusion else random.uniform(1, 6)
    middle = 0.0 if inclusion else 15.0
    north, east = random.uniform(-middle, middle), random.uniform(-middle, middle)
    corners = []
    for number in range(count):
        angle = 2 * pi * (number + random.uniform(-0.4, 0.4)) / count
        far = size * random.uniform(0.3, 1.0)
        corners.append(corner(north + far * cos(angle), east + far * sin(angle)))
    return Polygon(tuple(corners), inclusion, random.randrange(2) if inclusion else 0)


def circle(random: Random, *, inclusion: bool) -> Circle:
    radius = random.uniform(8, 20) if inclusion else random.uniform(0.5, 4)
    middle = 5.0 if inclusion else 15.0
    centre = corner(random.uniform(-middle, middle), random.uniform(-middle, middle))
    return Circle(centre, radius, inclusion, random.randrange(2) if inclusion else 0)


def zones_of(random: Random) -> tuple[Zone, ...]:
    inclusions = [random.choice((polygon, circle)) for _ in range(random.randrange(4))]
    exclusions = [random.choice((polygon, circle)) for _ in range(random.randrange(1, 5))]
    return (
        *(make(random, inclusion=True) for make in inclusions),
        *(make(random, inclusion=False) for make in exclusions),
    )


def xy(place: GlobalPlace) -> tuple[float, float]:
    local = to_local(place, ORIGIN)
    return local.north, local.east


def shape_of(zone: Zone) -> shapely.Geometry:
    if isinstance(zone, Circle):
        return Point(xy(zone.centre)).buffer(zone.radius, quad_segs=SEGMENTS)
    shape = Shape([xy(place) for place in zone.corners])
    assert shape.is_valid
    return shape


def allowed_ground(zones: tuple[Zone, ...]) -> shapely.Geometry:
    """Inside all of a group's zones, of whichever group; and outside what is excluded."""
    groups: dict[int, shapely.Geometry] = {}
    forbidden: list[shapely.Geometry] = []
    for zone in zones:
        shape = shape_of(zone)
        if not zone.is_inclusion:
            forbidden.append(shape)
        elif zone.group in groups:
            groups[zone.group] = groups[zone.group].intersection(shape)
        else:
            groups[zone.group] = shape
    everywhere = shapely.box(-200, -200, 200, 200)
    ground = shapely.union_all(list(groups.values())) if groups else everywhere
    return ground.difference(shapely.union_all(forbidden))


class Oracle:
    """What shapely says of places and ways."""

    def __init__(self, ground: shapely.Geometry) -> None:
        self._surely, self._perhaps = ground.buffer(-SURE), ground.buffer(SURE)

    def verdict(self, what: shapely.Geometry) -> bool | None:
        """Whether it lies on allowed ground; None: too near to a boundary to say."""
        if self._surely.covers(what):
            return True
        return None if self._perhaps.covers(what) else False


@pytest.mark.parametrize("seed", range(FENCES))
def test_places_and_ways_are_allowed_as_shapely_says(seed: int) -> None:
    random = Random(seed)
    zones = zones_of(random)
    fence, oracle = LocalFence(Fence(zones), ORIGIN), Oracle(allowed_ground(zones))
    said: Counter[tuple[str, bool | None]] = Counter()
    here = LocalPlace(0.0, 0.0)
    for _ in range(GOALS):
        there = LocalPlace(random.uniform(-20, 20), random.uniform(-20, 20))
        ends = [(here.north, here.east), (there.north, there.east)]
        place, way = oracle.verdict(Point(ends[1])), oracle.verdict(LineString(ends))
        said["place", place] += 1
        said["way", way] += 1
        if place is not None:
            assert fence.allows(there) is place, there
        if way is not None:
            assert fence.allows_way(here, there) is way, (here, there)
        here = there
    assert said["place", None] + said["way", None] < GOALS / 4, "it has an opinion nearly always"
