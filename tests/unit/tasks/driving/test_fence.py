"""Places and ways against a fence: its boundary in cases, and random ones as shapely judges."""

import re
from collections import Counter
from math import atan2, cos, inf, nan, pi, sin, tau
from random import Random

import pytest
import shapely
from shapely.geometry import LineString
from shapely.geometry import Polygon as Shape

from mav_tasks.kinds import GlobalPlace, GoTo, LocalPlace, Move, Pose
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.fence import Circle, Fence, LocalFence, Polygon, Zone, check
from mav_tasks.tasks.driving.frames import to_global, to_local
from mav_tasks.tasks.goal import Jump, SetSpeed

ORIGIN = GlobalPlace(0, 0)
EAST = pi / 2
ROUNDING = 0.012  # m, of a corner by its integers

Point = tuple[float, float]


def corner(north: float, east: float) -> GlobalPlace:
    return to_global(LocalPlace(north, east), ORIGIN)


def spot(north: float, east: float) -> Point:
    """The very place of a corner, after rounding."""
    place = to_local(corner(north, east), ORIGIN)
    return place.north, place.east


def polygon(*points: Point, inclusion: bool = True, group: int = 0) -> Polygon:
    return Polygon(tuple(corner(*point) for point in points), inclusion, group)


def box(south: float, west: float, north: float, east: float) -> tuple[Point, ...]:
    return (south, west), (south, east), (north, east), (north, west)


def fence(*zones: Zone) -> LocalFence:
    return LocalFence(Fence(zones), ORIGIN)


def allows(local: LocalFence, *points: Point) -> bool:
    """Whether a place, or the way from one to another, is allowed."""
    places = [LocalPlace(*point) for point in points]
    return local.allows(*places) if len(places) == 1 else local.allows_way(*places)


def room(local: LocalFence, pose: Pose, *, forward: bool = True, limit: float = 50.0) -> float:
    return local.room(pose, forward=forward, limit=limit)


#: a U, open to the north: its notch is 4 m wide and reaches down to 2 m north
U = ((0, 0), (0, 10), (10, 10), (10, 7), (2, 7), (2, 3), (10, 3), (10, 0))
BOX = box(0, 0, 10, 10)
YARD, POND = polygon(*BOX), polygon(*BOX, inclusion=False)
ROUND_YARD, ROUND_POND = Circle(ORIGIN, 5.0, True), Circle(ORIGIN, 5.0, False)
N, E = spot(10, 10)  # of the box's corner
STAR = [(10 * cos(2 * i * tau / 5), 10 * sin(2 * i * tau / 5)) for i in range(5)]
RIGHT = box(0, 6, 10, 16)  # overlaps the box between 6 and 10 east
EITHER = polygon(*BOX, group=1), polygon(*RIGHT, group=2)
MM = 0.001  # m: the boundary is that wide, on either side

ZONES: dict[str, tuple[Zone, ...]] = {
    "yard": (YARD,),
    "pond": (POND,),
    "round yard": (ROUND_YARD,),
    "round pond": (ROUND_POND,),
    "U": (polygon(*(p for p in U for _ in "ab")),),  # each corner twice
    "star": (polygon(*STAR),),  # where it covers twice is a hole
    "either": EITHER,
    "neighbours": (EITHER[0], polygon(*box(0, 10, 10, 16), group=2)),  # they share an edge
}


def point(text: str) -> Point:
    """Return a place by its metres or "mm" north and east; N and E are of the box's corner."""
    known = {"N": N, "E": E}
    north, east = (
        sum(
            known[term] if term in known else float(term.removesuffix("mm")) * unit
            for term in re.findall(r"[+-]?[\w.]+", part)
            for unit in [MM if term.endswith("mm") else 1.0]
        )
        for part in text.split(",")
    )
    return north, east


def test_places_are_allowed_or_not() -> None:
    for row in """yard: N,E no; N-0.9mm,5 no; N-1.1mm,5 yes
        pond: N,5 no; N+0.9mm,5 no; N+1.1mm,5 yes
        yard: 5,E-0.9mm no; 5,E-1.1mm yes; 5,E+1.1mm no
        pond: N+0.6mm,E+0.6mm no; N+0.9mm,E+0.9mm yes
        round yard: 5-0.9mm,0 no; 5,0 no; 5-1.1mm,0 yes
        round pond: 5+0.9mm,0 no; 5,0 no; 5+1.1mm,0 yes
        U: 1,5 yes; 5,5 no
        star: 7,0 yes; 0,0 no""".splitlines():
        zones, _, places = row.strip().partition(": ")
        for place in places.split("; "):
            where, answer = place.split(" ")
            assert allows(fence(*ZONES[zones]), point(where)) is (answer == "yes"), (zones, place)


#: through the pond though both ends are allowed, touching its corner, along an edge or in line with
#: it through a corner; a tangent; of no length; from one group to another
WAYS = """pond: 5,-5 5,15 no
pond: N+4,E-4 N-4,E+4 no
pond: N+4+2mm,E-4 N-4+2mm,E+4 yes
pond: N,2 N,8 no
pond: N,-5 N,15 no
pond: N,11 N,15 yes
pond: N+0.9mm,11 N,-5 no
pond: N+1.5mm,-50 N+1.5mm,15 yes
round pond: 5,-9 5,9 no
round pond: 5+0.9mm,-9 5+0.9mm,9 no
round pond: 5+1.1mm,-9 5+1.1mm,9 yes
yard: 5,5 5,5 yes
yard: N,5 N,5 no
either: 5,1 5,15 yes
neighbours: 5,1 5,15 no"""


def test_ways_are_allowed_or_not_in_both_directions() -> None:
    for row in WAYS.splitlines():
        zones, _, rest = row.partition(": ")
        *ends, answer = rest.split(" ")
        way = [point(end) for end in ends]
        for direction in (way, way[::-1]):
            assert allows(fence(*ZONES[zones]), *direction) is (answer == "yes"), row


def test_a_way_between_places_of_a_plan_is_found_whatever_lies_between() -> None:
    bounds, start, end = Bounds(), GoTo(corner(5, -5)), GoTo(corner(5, 15))
    bounds.fence = Fence((POND,))
    for between, found in ((SetSpeed(1.0), 2), (Jump(2, 1), 2), (Move(1.0), None)):
        assert bounds.forbidden_leg((start, between, end), ORIGIN) == found, between
    assert bounds.refuge(Pose(0.0, 0.0, 0.0), ORIGIN) is None


def test_the_room_ends_a_millimetre_before_the_boundary() -> None:
    hole = Circle(ORIGIN, 10.0, True), Circle(corner(3, 4), 1.0, False)
    ahead = Pose(0.0, 0.0, atan2(4, 3))
    cases: tuple[tuple[tuple[Zone, ...], Pose, bool, float], ...] = (
        ((YARD,), Pose(5, 2, EAST), True, E - 2 - MM),
        ((YARD,), Pose(5, E - 8, EAST), False, E - 8 - spot(0, 0)[1] - MM),
        ((ROUND_POND,), Pose(-9, 0, pi), False, 4 - MM),
        (ZONES["U"], Pose(1, 5, 0), True, spot(2, 3)[0] - 1 - MM),
        ((POND,), Pose(5, 5, 0), True, 0.0),  # where it may not be
    )
    for zones, pose, forward, wanted in cases:
        found = room(fence(*zones), pose, forward=forward)
        assert found == pytest.approx(wanted, abs=1e-6), (zones, pose)
    assert room(fence(*hole), ahead) == pytest.approx(4.0, abs=ROUNDING)
    assert room(fence(*hole), ahead, forward=False) == pytest.approx(10.0, abs=ROUNDING)
    for limit in (0.0, 3.0):
        assert room(fence(YARD), Pose(5, 2, EAST), limit=limit) == limit


def test_across_the_date_line_it_is_one_fence() -> None:
    west, east = 1_799_999_000, -1_799_999_000
    corners = [(-1000, west), (-1000, east), (1000, east), (1000, west)]
    zone = Polygon(tuple(GlobalPlace(*each) for each in corners), is_inclusion=True)
    for origin, middle in ((GlobalPlace(0, west), 11.13), (GlobalPlace(0, east), -11.13)):
        yard = LocalFence(Fence((zone,)), origin)
        assert allows(yard, (0.0, middle - 10), (0.0, middle + 10))
        assert not any(allows(yard, (0.0, middle + off)) for off in (12, -12))


def test_what_is_wrong_with_a_fence_is_said_in_words() -> None:
    thin = [(0, 1_799_999_990), (0, -1_799_999_990), (10, 1_799_999_990)]
    few, flat = "a polygon needs at least 3 corners, not", "a polygon has no area"
    cases: dict[Zone, str | None] = {
        Circle(ORIGIN, 0.5, False): None,
        polygon((0, 0), (9, 9), (0, 9), (9, 0)): None,  # it crosses itself
        Polygon(tuple(GlobalPlace(*each) for each in thin), True): None,
        Polygon((), True): f"{few} 0",
        polygon((0, 0), (9, 9)): f"{few} 2",
        Polygon((ORIGIN,) * 3, False): flat,
        polygon((0, 0), (5, 9), (10, 18), (5, 9)): flat,
        Circle(ORIGIN, 0.0, True): "a circle needs a positive radius, not 0 m",
        Circle(ORIGIN, -2.5, True): "a circle needs a positive radius, not -2.5 m",
        Circle(ORIGIN, inf, True): "a circle needs a positive radius, not inf m",
        Circle(ORIGIN, nan, True): "a circle needs a positive radius, not nan m",
    }
    assert {zone: check(Fence((YARD, zone))) for zone in cases} == cases
    assert check(Fence()) is None


# The oracle: shapely.

SURE = 0.003  # m; nearer to a boundary than that the two need not agree
SEGMENTS = 256  # of a quarter of a circle: 0.1 mm off at 5 m


def random_zone(random: Random, *, inclusion: bool) -> Zone:
    """A circle, or a polygon round its middle, with notches, that does not cross itself."""
    group = random.randrange(2) if inclusion else 0
    spread = 3.0 if inclusion else 15.0
    middle = random.uniform(-spread, spread), random.uniform(-spread, spread)
    size = random.uniform(8, 25) if inclusion else random.uniform(0.5, 6)
    if random.random() < 0.5:
        return Circle(corner(*middle), size, inclusion, group)
    count = random.randrange(3, 12)
    points = []
    for number in range(count):
        angle = tau * (number + random.uniform(-0.4, 0.4)) / count
        far = size * random.uniform(0.3, 1.0)
        points.append((middle[0] + far * cos(angle), middle[1] + far * sin(angle)))
    return polygon(*points, inclusion=inclusion, group=group)


def shape_of(zone: Zone) -> shapely.Geometry:
    places = (zone.centre,) if isinstance(zone, Circle) else zone.corners
    points = [(each.north, each.east) for each in (to_local(place, ORIGIN) for place in places)]
    if isinstance(zone, Circle):
        return shapely.Point(points[0]).buffer(zone.radius, quad_segs=SEGMENTS)
    return Shape(points)


def allowed_ground(zones: list[Zone]) -> shapely.Geometry:
    """Inside all of a group's zones, of whichever group; and outside what is excluded."""
    groups: dict[int, shapely.Geometry] = {}
    for zone in zones:
        if zone.is_inclusion:
            before = groups.get(zone.group, shape_of(zone))
            groups[zone.group] = before.intersection(shape_of(zone))
    ground = shapely.union_all([*groups.values()]) if groups else shapely.box(-99, -99, 99, 99)
    forbidden = [shape_of(zone) for zone in zones if not zone.is_inclusion]
    return ground.difference(shapely.union_all(forbidden))


@pytest.mark.timeout(180)
def test_places_ways_and_rooms_are_as_shapely_says() -> None:
    said: Counter[tuple[str, bool | None]] = Counter()
    for seed in range(150):
        random = Random(seed)
        zones = [random_zone(random, inclusion=True) for _ in range(random.randrange(4))]
        zones += [random_zone(random, inclusion=False) for _ in range(random.randrange(1, 5))]
        local, ground = fence(*zones), allowed_ground(zones)
        surely, perhaps = ground.buffer(-SURE), ground.buffer(SURE)
        here = (0.0, 0.0)
        for _ in range(30):
            there = random.uniform(-20, 20), random.uniform(-20, 20)
            way = LineString((here, there))
            told = seed, here, there
            for name, what, found in (
                ("place", shapely.Point(there), allows(local, there)),
                ("way", way, allows(local, here, there)),
            ):
                verdict = True if surely.covers(what) else None if perhaps.covers(what) else False
                said[name, verdict] += 1
                assert verdict in (None, found), (name, told)
            if local.escapes(LocalPlace(*here), LocalPlace(*there)):
                said["escape", True] += 1
                inside = surely.intersection(way)
                assert inside.geom_type == "LineString", told
                assert not surely.covers(shapely.Point(here)), told
                assert perhaps.covers(shapely.Point(there)), told
            pose = Pose(*here, atan2(there[1] - here[1], there[0] - here[0]))
            free = room(local, pose, limit=way.length)
            end = way.line_interpolate_point(free)
            if free > 0:
                assert perhaps.covers(LineString((here, end.coords[0]))), told
            if free < way.length:
                assert not surely.covers(end.buffer(SURE)), told
            here = there
    unsure = said["place", None] + said["way", None]
    assert unsure < said.total() / 50, "it has an opinion nearly always"
    assert min(said[name, True] for name in ("place", "way", "escape")) > 50
