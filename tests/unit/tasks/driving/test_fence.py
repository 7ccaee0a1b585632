"""Places and ways against a fence: cases in words, and two oracles that share nothing with it.

One oracle turns round a place and adds up angles, and walks a way by steps as long as its distance
to the next boundary. The other works in whole numbers on a grid, exactly, where ways run through
corners and along edges all the time.
"""

from collections.abc import Iterator
from math import atan2, cos, hypot, inf, nan, pi, sin, tau

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from mav_tasks.tasks.driving.fence import Circle, Fence, LocalFence, Polygon, Zone, check
from mav_tasks.tasks.frames import to_global, to_local
from mav_tasks.tasks.goal import GlobalPlace, LocalPlace
from mav_tasks.tasks.task import Pose

ORIGIN = GlobalPlace(0, 0)
NORTHWARDS, EASTWARDS = 0.0, pi / 2
ROUNDING = 0.012  # m, of a corner by its integers

Point = tuple[float, float]


def at(north: float, east: float) -> LocalPlace:
    return LocalPlace(north, east)


def corner(north: float, east: float) -> GlobalPlace:
    return to_global(LocalPlace(north, east), ORIGIN)


def spot(north: float, east: float) -> LocalPlace:
    """The very place of a corner, after rounding."""
    return to_local(corner(north, east), ORIGIN)


def polygon(*points: Point, inclusion: bool, group: int = 0) -> Polygon:
    return Polygon(tuple(corner(*point) for point in points), inclusion, group)


def box(south: float, west: float, north: float, east: float) -> tuple[Point, ...]:
    return (south, west), (south, east), (north, east), (north, west)


def circle(north: float, east: float, radius: float, *, inclusion: bool, group: int = 0) -> Circle:
    return Circle(corner(north, east), radius, inclusion, group)


def fence(*zones: Zone) -> LocalFence:
    return LocalFence(Fence(zones), ORIGIN)


YARD = polygon(*box(0, 0, 10, 10), inclusion=True)
POND = polygon(*box(0, 0, 10, 10), inclusion=False)
#: a U, open to the north: its notch is 4 m wide and reaches down to 2 m north
U = ((0, 0), (0, 10), (10, 10), (10, 7), (2, 7), (2, 3), (10, 3), (10, 0))


class TestPlaces:
    def test_without_a_fence_every_place_is_allowed(self) -> None:
        nothing = fence()
        assert nothing.allows(at(1e6, -1e6))
        assert nothing.allows_way(at(1e6, -1e6), at(-1e6, 1e6))
        assert nothing.room(Pose(0.0, 0.0, 1.0), forward=True, limit=50.0) == 50.0

    def test_inside_an_inclusion_zone_is_allowed_and_outside_is_not(self) -> None:
        yard = fence(YARD)
        assert yard.allows(at(5.0, 5.0))
        assert not any(
            yard.allows(place)
            for place in (at(5.0, 11.0), at(5.0, -1.0), at(11.0, 5.0), at(-1.0, 5.0))
        )

    def test_inside_an_exclusion_zone_is_forbidden_and_outside_is_allowed(self) -> None:
        pond = fence(POND)
        assert not pond.allows(at(5.0, 5.0))
        assert pond.allows(at(5.0, 11.0))

    def test_a_pond_in_the_yard_is_forbidden(self) -> None:
        yard = fence(YARD, circle(5.0, 5.0, 2.0, inclusion=False))
        assert yard.allows(at(1.0, 1.0))
        assert not yard.allows(at(5.0, 6.0))
        assert not yard.allows(at(20.0, 20.0))

    @pytest.mark.parametrize("inclusion", [True, False])
    def test_the_boundary_is_forbidden_by_a_millimetre_on_either_side(
        self, inclusion: bool
    ) -> None:
        polygonal = fence(polygon(*box(0, 0, 10, 10), inclusion=inclusion))
        edge = spot(10, 10)
        for place in (edge, at(edge.north, 5.0), at(5.0, edge.east)):
            assert not polygonal.allows(place)
        for off in (-0.0009, 0.0009):
            assert not polygonal.allows(at(edge.north + off, 5.0))
            assert not polygonal.allows(at(5.0, edge.east + off))
        for off in (-0.0011, 0.0011):
            assert polygonal.allows(at(edge.north + off, 5.0)) == ((off < 0) == inclusion)
            assert polygonal.allows(at(5.0, edge.east + off)) == ((off < 0) == inclusion)

    @pytest.mark.parametrize("inclusion", [True, False])
    def test_a_circle_has_that_millimetre_too(self, inclusion: bool) -> None:
        round_one = fence(Circle(ORIGIN, 5.0, inclusion))
        assert [round_one.allows(at(5.0 + off, 0.0)) for off in (-0.0009, 0.0, 0.0009)] == [
            False
        ] * 3
        assert round_one.allows(at(4.9989, 0.0)) == inclusion
        assert round_one.allows(at(5.0011, 0.0)) != inclusion

    def test_a_corner_is_rounded_by_its_millimetre(self) -> None:
        pond, edge = fence(POND), spot(10, 10)
        assert not pond.allows(at(edge.north + 0.0006, edge.east + 0.0006))
        assert pond.allows(at(edge.north + 0.0009, edge.east + 0.0009))

    def test_either_way_round_is_the_same_polygon(self) -> None:
        other = fence(polygon(*reversed(U), inclusion=True))
        for place, is_allowed in ((at(1, 5), True), (at(5, 5), False), (at(5, 8), True)):
            assert fence(polygon(*U, inclusion=True)).allows(place) == is_allowed
            assert other.allows(place) == is_allowed

    def test_a_polygon_that_crosses_itself_has_a_hole_where_it_covers_twice(self) -> None:
        star = [(10 * cos(2 * i * tau / 5), 10 * sin(2 * i * tau / 5)) for i in range(5)]
        starry = fence(polygon(*star, inclusion=True))
        assert starry.allows(at(7.0, 0.0))
        assert not starry.allows(at(0.0, 0.0))

    def test_a_corner_that_comes_twice_changes_nothing(self) -> None:
        doubled = fence(polygon(*(p for point in U for p in (point, point)), inclusion=True))
        assert doubled.allows(at(1.0, 5.0))
        assert not doubled.allows(at(5.0, 5.0))
        assert doubled.room(Pose(1.0, 5.0, NORTHWARDS), forward=True, limit=9.0) == pytest.approx(
            1.0, abs=ROUNDING
        )

    def test_level_with_a_corner_is_no_other_than_beside_it(self) -> None:
        diamond = polygon((0, -10), (10, 0), (0, 10), (-10, 0), inclusion=True)
        level = spot(0, 10).north
        assert fence(diamond).allows(at(level, 0.0))
        assert not fence(diamond).allows(at(level, -20.0))
        assert not fence(diamond).allows(at(spot(10, 0).north, -5.0))


class TestGroups:
    LEFT = box(0, 0, 10, 10)
    RIGHT = box(0, 6, 10, 16)  # overlaps LEFT between 6 and 10 east

    def test_of_one_group_all_zones_have_to_hold(self) -> None:
        both = fence(
            polygon(*self.LEFT, inclusion=True, group=3),
            polygon(*self.RIGHT, inclusion=True, group=3),
        )
        assert [both.allows(at(5.0, east)) for east in (3.0, 8.0, 13.0)] == [False, True, False]

    def test_of_several_groups_one_is_enough(self) -> None:
        either = fence(
            polygon(*self.LEFT, inclusion=True, group=1),
            polygon(*self.RIGHT, inclusion=True, group=2),
        )
        allowed = [either.allows(at(5.0, east)) for east in (3.0, 8.0, 13.0, 17.0)]
        assert allowed == [True, True, True, False]

    def test_a_circle_is_of_a_group_like_a_polygon(self) -> None:
        ring = circle(5.0, 10.0, 3.0, inclusion=True, group=1)
        both = fence(polygon(*self.LEFT, inclusion=True, group=1), ring)
        assert [both.allows(at(5.0, east)) for east in (3.0, 8.0, 12.0)] == [False, True, False]

    def test_an_exclusion_zone_holds_for_all_groups(self) -> None:
        either = fence(
            polygon(*self.LEFT, inclusion=True, group=1),
            polygon(*self.RIGHT, inclusion=True, group=2),
            Circle(corner(5.0, 13.0), 1.0, is_inclusion=False, group=1),
        )
        assert not either.allows(at(5.0, 13.0))

    def test_a_way_may_go_over_from_one_group_to_another_where_they_overlap(self) -> None:
        either = fence(
            polygon(*self.LEFT, inclusion=True, group=1),
            polygon(*self.RIGHT, inclusion=True, group=2),
        )
        assert either.allows_way(at(5.0, 1.0), at(5.0, 15.0))
        assert either.room(Pose(5.0, 1.0, EASTWARDS), forward=True, limit=99.0) == pytest.approx(
            15.0, abs=ROUNDING
        )

    def test_not_where_there_is_a_gap_or_no_more_than_a_shared_edge(self) -> None:
        for west in (10, 10.1):
            either = fence(
                polygon(*self.LEFT, inclusion=True, group=1),
                polygon(*box(0, west, 10, 16), inclusion=True, group=2),
            )
            assert not either.allows_way(at(5.0, 1.0), at(5.0, 15.0))
            assert either.room(
                Pose(5.0, 1.0, EASTWARDS), forward=True, limit=99.0
            ) == pytest.approx(9.0, abs=ROUNDING)


class TestWays:
    def test_across_the_notch_of_a_concave_yard_is_not_allowed(self) -> None:
        yard = fence(polygon(*U, inclusion=True))
        assert yard.allows(at(8.0, 1.0))
        assert yard.allows(at(8.0, 9.0))
        assert not yard.allows_way(at(8.0, 1.0), at(8.0, 9.0))
        assert yard.allows_way(at(1.0, 1.0), at(1.0, 9.0))

    def test_into_and_out_of_a_notch_of_a_pond_is_allowed(self) -> None:
        pond = fence(polygon(*U, inclusion=False))
        assert pond.allows_way(at(12.0, 5.0), at(3.0, 5.0))
        assert not pond.allows_way(at(12.0, 5.0), at(1.0, 5.0))

    def test_through_a_pond_is_not_allowed_though_both_ends_are(self) -> None:
        assert not fence(POND).allows_way(at(5.0, -5.0), at(5.0, 15.0))
        assert not fence(circle(0, 0, 1, inclusion=False)).allows_way(at(0, -50), at(0, 50))

    def test_touching_a_corner_counts_as_crossing(self) -> None:
        edge = spot(10, 10)
        start, end = at(edge.north + 4, edge.east - 4), at(edge.north - 4, edge.east + 4)
        assert not fence(POND).allows_way(start, end)
        past = [at(place.north + 0.002, place.east) for place in (start, end)]
        assert fence(POND).allows_way(*past)
        yard, inner = fence(polygon(*U, inclusion=True)), spot(2, 3)
        assert not yard.allows_way(
            at(inner.north + 1.0, inner.east - 1.0), at(inner.north - 1.0, inner.east + 1.0)
        )

    def test_along_an_edge_or_in_line_with_it_through_a_corner_is_not_allowed(self) -> None:
        edge = spot(10, 10)
        assert not fence(POND).allows_way(at(edge.north, 2.0), at(edge.north, 8.0))
        assert not fence(POND).allows_way(at(edge.north, -5.0), at(edge.north, 15.0))
        assert fence(POND).allows_way(at(edge.north, 11.0), at(edge.north, 15.0))
        assert not fence(POND).allows_way(at(edge.north + 0.0009, 11.0), at(edge.north, -5.0))

    def test_half_a_millimetre_beside_an_edge_is_not_allowed_either_way(self) -> None:
        edge = spot(10, 10)
        for off, is_allowed in ((0.0005, False), (0.0015, True)):
            west, east = at(edge.north + off, -50.0), at(edge.north + off, 15.0)
            assert fence(POND).allows_way(west, east) == is_allowed
            assert fence(POND).allows_way(east, west) == is_allowed

    def test_a_tangent_to_a_round_pond_is_not_allowed(self) -> None:
        pond = fence(Circle(ORIGIN, 5.0, is_inclusion=False))
        assert not pond.allows_way(at(5.0, -9.0), at(5.0, 9.0))
        assert not pond.allows_way(at(5.0009, -9.0), at(5.0009, 9.0))
        assert pond.allows_way(at(5.0011, -9.0), at(5.0011, 9.0))

    def test_from_inside_to_inside_a_round_yard_is_allowed(self) -> None:
        yard = fence(Circle(ORIGIN, 5.0, is_inclusion=True))
        assert yard.allows_way(at(0.0, -4.99), at(0.0, 4.99))
        assert not yard.allows_way(at(0.0, -4.99), at(0.0, 5.01))

    def test_a_way_that_begins_or_ends_outside_is_not_allowed(self) -> None:
        assert not fence(YARD).allows_way(at(5.0, -1.0), at(5.0, 5.0))
        assert not fence(YARD).allows_way(at(5.0, 5.0), at(5.0, -1.0))
        assert not fence(POND).allows_way(at(5.0, 5.0), at(5.0, 5.1))

    def test_a_way_of_no_length_is_a_place(self) -> None:
        for place in (at(5.0, 5.0), at(5.0, 11.0), at(spot(10, 10).north, 5.0)):
            for zone in (YARD, POND):
                assert fence(zone).allows_way(place, place) == fence(zone).allows(place)
                assert not fence(zone).escapes(place, place)


class TestEscapes:
    def test_back_into_the_yard_and_out_of_the_pond(self) -> None:
        assert fence(YARD).escapes(at(5.0, -3.0), at(5.0, 5.0))
        assert fence(POND).escapes(at(5.0, 5.0), at(5.0, -3.0))

    def test_not_from_where_the_vehicle_may_be(self) -> None:
        assert not fence(YARD).escapes(at(5.0, 5.0), at(5.0, 6.0))
        assert not fence(YARD).escapes(at(5.0, 5.0), at(5.0, -3.0))

    def test_not_to_where_it_may_not_be_either(self) -> None:
        assert not fence(YARD).escapes(at(5.0, -3.0), at(5.0, -1.0))
        assert not fence(YARD).escapes(at(5.0, -3.0), at(5.0, 13.0))

    def test_not_if_it_leads_out_again_before_it_ends_inside(self) -> None:
        yard = fence(polygon(*U, inclusion=True))
        assert yard.escapes(at(8.0, -2.0), at(8.0, 2.0))
        assert not yard.escapes(at(8.0, -2.0), at(8.0, 9.0))

    def test_from_one_pond_into_another_and_out_of_both_is_once(self) -> None:
        ponds = fence(POND, polygon(*box(0, 8, 10, 20), inclusion=False))
        assert ponds.escapes(at(5.0, 5.0), at(5.0, 25.0))


class TestRoom:
    def test_is_what_lies_ahead_or_behind(self) -> None:
        pose = Pose(5.0, 2.0, EASTWARDS)
        assert fence(YARD).room(pose, forward=True, limit=50.0) == pytest.approx(8.0, abs=ROUNDING)
        assert fence(YARD).room(pose, forward=False, limit=50.0) == pytest.approx(2.0, abs=ROUNDING)

    def test_ends_a_millimetre_before_the_boundary(self) -> None:
        edge = spot(10, 10)
        pose = Pose(edge.north - 4.0, 5.0, NORTHWARDS)
        assert fence(YARD).room(pose, forward=True, limit=50.0) == pytest.approx(3.999, abs=1e-6)
        pond = fence(Circle(ORIGIN, 5.0, is_inclusion=False))
        assert pond.room(Pose(-9.0, 0.0, pi), forward=False, limit=50.0) == pytest.approx(
            3.999, abs=1e-6
        )

    def test_ends_so_inside_a_round_yard_and_before_a_sharp_corner(self) -> None:
        yard = fence(Circle(ORIGIN, 5.0, is_inclusion=True))
        assert yard.room(Pose(1.0, 0.0, NORTHWARDS), forward=True, limit=50.0) == pytest.approx(
            3.999, abs=1e-6
        )
        spike = fence(polygon((0, 0), (100, 10), (100, -10), inclusion=False))
        assert spike.room(Pose(-5.0, 0.0, NORTHWARDS), forward=True, limit=50.0) == pytest.approx(
            4.999, abs=1e-6
        )

    def test_follows_the_heading(self) -> None:
        yard = fence(Circle(ORIGIN, 10.0, is_inclusion=True), circle(3, 4, 1, inclusion=False))
        ahead = Pose(0.0, 0.0, atan2(4, 3))
        assert yard.room(ahead, forward=True, limit=50.0) == pytest.approx(4.0, abs=ROUNDING)
        assert yard.room(ahead, forward=False, limit=50.0) == pytest.approx(10.0, abs=ROUNDING)

    def test_is_never_more_than_the_limit(self) -> None:
        pose = Pose(5.0, 2.0, EASTWARDS)
        assert fence(YARD).room(pose, forward=True, limit=3.0) == 3.0
        assert fence(YARD).room(pose, forward=True, limit=0.0) == 0.0
        assert fence(YARD).room(pose, forward=False, limit=3.0) < 2.1

    def test_is_nothing_where_the_vehicle_may_not_be(self) -> None:
        assert fence(POND).room(Pose(5.0, 5.0, 0.0), forward=True, limit=50.0) == 0.0
        assert fence(YARD).room(Pose(15.0, 5.0, pi), forward=True, limit=50.0) == 0.0


class TestFarAndWide:
    def test_a_fence_of_a_hundred_kilometres_is_as_exact(self) -> None:
        size = 100_000
        yard = fence(
            polygon(*box(-size, -size, size, size), inclusion=True),
            polygon((0, 0), (size, 10), (size, -10), inclusion=False),
        )
        tip, east = spot(0, 0), spot(size, size).east
        assert not yard.allows_way(at(tip.north - 0.0009, -9e4), at(tip.north - 0.0009, 9e4))
        assert yard.allows_way(at(tip.north - 0.0011, -9e4), at(tip.north - 0.0011, 9e4))
        room = yard.room(Pose(-5.0, -99_000.0, EASTWARDS), forward=True, limit=1e6)
        assert room == pytest.approx(east + 99_000.0 - 0.001, abs=1e-6)

    def test_across_the_date_line_it_is_one_fence(self) -> None:
        west, east = 1_799_999_000, -1_799_999_000
        corners = [(-1000, west), (-1000, east), (1000, east), (1000, west)]
        zone = Polygon(tuple(GlobalPlace(*each) for each in corners), is_inclusion=True)
        for origin, middle in ((GlobalPlace(0, west), 11.13), (GlobalPlace(0, east), -11.13)):
            yard = LocalFence(Fence((zone,)), origin)
            assert yard.allows_way(at(0.0, middle - 10), at(0.0, middle + 10))
            assert not yard.allows(at(0.0, middle + 12))
            assert not yard.allows(at(0.0, middle - 12))


class TestCheck:
    def test_nothing_is_wrong_with_a_good_fence(self) -> None:
        assert check(Fence()) is None
        assert check(Fence((YARD, circle(0, 0, 0.5, inclusion=False)))) is None

    @pytest.mark.parametrize(
        ("zone", "words"),
        [
            (Polygon((), True), "a polygon needs at least 3 corners, not 0"),
            (Polygon((ORIGIN,), True), "a polygon needs at least 3 corners, not 1"),
            (
                polygon((0, 0), (9, 9), inclusion=True),
                "a polygon needs at least 3 corners, not 2",
            ),
            (Polygon((ORIGIN,) * 3, False), "a polygon has no area"),
            (polygon((0, 0), (5, 9), (10, 18), (5, 9), inclusion=True), "a polygon has no area"),
            (Circle(ORIGIN, 0.0, True), "a circle needs a positive radius, not 0 m"),
            (Circle(ORIGIN, -2.5, True), "a circle needs a positive radius, not -2.5 m"),
            (Circle(ORIGIN, inf, True), "a circle needs a positive radius, not inf m"),
            (Circle(ORIGIN, nan, True), "a circle needs a positive radius, not nan m"),
        ],
    )
    def test_what_is_wrong_is_said_in_words(self, zone: Zone, words: str) -> None:
        assert check(Fence((YARD, zone))) == words

    def test_a_polygon_that_crosses_itself_is_all_right(self) -> None:
        assert check(Fence((polygon((0, 0), (9, 9), (0, 9), (9, 0), inclusion=True),))) is None

    def test_a_thin_one_is_all_right_across_the_date_line(self) -> None:
        corners = [(0, 1_799_999_990), (0, -1_799_999_990), (10, 1_799_999_990)]
        assert check(Fence((Polygon(tuple(GlobalPlace(*c) for c in corners), True),))) is None


# The first oracle: how deep in allowed ground a place is, in metres, negative in forbidden ground.
# A step of d metres changes that by no more than d.


def depth(zones: tuple[Zone, ...], place: LocalPlace) -> float:
    outside = [-inwards(zone, place) for zone in zones if not zone.is_inclusion]
    groups = {zone.group for zone in zones if zone.is_inclusion}
    inside = [
        min(inwards(zone, place) for zone in zones if zone.is_inclusion and zone.group == group)
        for group in groups
    ]
    return min([*outside, max(inside, default=inf)])


def inwards(zone: Zone, place: LocalPlace) -> float:
    """The metres to a zone's boundary, negative outside."""
    if isinstance(zone, Circle):
        centre = to_local(zone.centre, ORIGIN)
        return zone.radius - hypot(place.north - centre.north, place.east - centre.east)
    rays = [
        complex(spot.north - place.north, spot.east - place.east)
        for spot in (to_local(each, ORIGIN) for each in zone.corners)
    ]
    pairs = list(zip(rays, [*rays[1:], rays[0]], strict=True))
    turned = sum(angle(one, other) for one, other in pairs)
    distance = min(from_edge(one, other) for one, other in pairs)
    return distance if round(turned / tau) % 2 else -distance


def angle(one: complex, other: complex) -> float:
    return atan2((one.conjugate() * other).imag, (one.conjugate() * other).real)


def from_edge(one: complex, other: complex) -> float:
    """The distance of an edge from 0, by the sides of the triangle."""
    a, b, c = abs(one), abs(other), abs(other - one)
    if c == 0 or a * a >= b * b + c * c or b * b >= a * a + c * c:
        return min(a, b)
    return abs((one.conjugate() * other).imag) / c


def walked(zones: tuple[Zone, ...], start: LocalPlace, end: LocalPlace) -> Iterator[float]:
    """Depths along a way, so near to each other that none is passed over but near a boundary."""
    length = hypot(end.north - start.north, end.east - start.east)
    along = 0.0
    while along < length:
        part = along / length
        now = depth(
            zones,
            at(
                start.north + part * (end.north - start.north),
                start.east + part * (end.east - start.east),
            ),
        )
        yield now
        along += max(abs(now), STEP)
    yield depth(zones, end)


STEP = 0.1  # m
SURE = 0.002  # m; nearer than that to a boundary the oracle has no opinion

coordinates = st.floats(-30, 30).map(lambda x: round(x, 2))
places = st.builds(LocalPlace, coordinates, coordinates)
angles = st.floats(-pi, pi)
polygons = st.builds(
    lambda points, inclusion, group: polygon(*points, inclusion=inclusion, group=group),
    st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=9),
    st.booleans(),
    st.integers(0, 2),
)
circles = st.builds(
    lambda place, radius, inclusion, group: circle(
        place.north, place.east, radius, inclusion=inclusion, group=group
    ),
    places,
    st.floats(0.1, 30),
    st.booleans(),
    st.integers(0, 2),
)
fences = st.lists(polygons | circles, max_size=4).map(tuple)
quick = settings(max_examples=100, deadline=None)


@quick
@given(fences, st.lists(places, min_size=10, max_size=10))
def test_places_are_allowed_as_turning_round_says(
    zones: tuple[Zone, ...], somewhere: list[LocalPlace]
) -> None:
    local = LocalFence(Fence(zones), ORIGIN)
    for place in somewhere:
        deep = depth(zones, place)
        if abs(deep) > SURE:
            assert local.allows(place) == (deep > 0)


@quick
@given(fences, places, places)
def test_ways_are_allowed_as_walking_them_says(
    zones: tuple[Zone, ...], start: LocalPlace, end: LocalPlace
) -> None:
    local = LocalFence(Fence(zones), ORIGIN)
    depths = list(walked(zones, start, end))
    if min(depths) < -SURE:
        assert not local.allows_way(start, end)
    elif min(depths) > STEP:
        assert local.allows_way(start, end)


@quick
@given(fences, places, places)
def test_ways_back_are_found_as_walking_them_says(
    zones: tuple[Zone, ...], start: LocalPlace, end: LocalPlace
) -> None:
    local = LocalFence(Fence(zones), ORIGIN)
    states = [deep > 0 for deep in walked(zones, start, end) if abs(deep) > SURE]
    assume(states)
    if local.escapes(start, end):
        assert states == sorted(states)
    if local.allows_way(start, end):
        assert all(states)
    if not local.allows(start) and local.allows(end) and states != sorted(states):
        assert not local.escapes(start, end)


@quick
@given(fences, places, angles, st.booleans(), st.floats(0, 80))
def test_the_room_is_all_allowed_and_none_is_given_away(
    zones: tuple[Zone, ...], place: LocalPlace, yaw: float, forward: bool, limit: float
) -> None:
    local = LocalFence(Fence(zones), ORIGIN)
    room = local.room(Pose(place.north, place.east, yaw), forward=forward, limit=limit)
    heading = yaw if forward else yaw + pi
    end = at(place.north + room * cos(heading), place.east + room * sin(heading))
    assert 0 <= room <= limit
    if room > 0:
        assert min(walked(zones, place, end)) > 0.0009
    if 0 < room < limit:
        assert depth(zones, end) < 0.0011
    if room == 0 < limit:
        assert depth(zones, place) < 0.0011


@quick
@given(fences, places, places, st.lists(st.floats(0, 1), min_size=5, max_size=5))
def test_a_way_is_the_same_backwards_and_in_two_parts(
    zones: tuple[Zone, ...], start: LocalPlace, end: LocalPlace, parts: list[float]
) -> None:
    local = LocalFence(Fence(zones), ORIGIN)
    is_allowed = local.allows_way(start, end)
    assert local.allows_way(end, start) == is_allowed
    for part in parts:
        via = at(
            start.north + part * (end.north - start.north),
            start.east + part * (end.east - start.east),
        )
        if is_allowed:
            assert local.allows(via)
            assert local.allows_way(start, via)
            assert local.allows_way(via, end)


# The second oracle: corners and ends of ways on a grid of 11 m, and all reckoning in whole numbers.

CELL = 1000  # degE7

nodes = st.tuples(st.integers(-4, 4), st.integers(-4, 4))
Node = tuple[int, int]


def turn(a: Node, b: Node, c: Node) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def is_between(a: Node, b: Node, c: Node) -> bool:
    """Whether c, which is in line with a and b, is on the edge from a to b."""
    return (a[0] - c[0]) * (b[0] - c[0]) + (a[1] - c[1]) * (b[1] - c[1]) <= 0


def meet(a: Node, b: Node, c: Node, d: Node) -> bool:
    """Whether two edges have any point in common."""
    turns = turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)
    if turns[0] * turns[1] < 0 and turns[2] * turns[3] < 0:
        return True
    inline = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(t == 0 and is_between(*three) for t, three in zip(turns, inline, strict=True))


def is_within(node: Node, corners: list[Node]) -> bool:
    """Whether a node that is on no edge is inside: by a ray that passes no corner."""
    beyond = (node[0] + 1, node[1] + 1000)
    edges = zip(corners, [*corners[1:], corners[0]], strict=True)
    return sum(meet(node, beyond, *edge) for edge in edges) % 2 == 1


def on_grid(node: Node) -> GlobalPlace:
    return GlobalPlace(node[0] * CELL, node[1] * CELL)


@settings(max_examples=300, deadline=None)
@given(st.lists(nodes, min_size=3, max_size=8), nodes, nodes)
@example([(0, 0), (0, 2), (2, 2), (2, 0)], (2, -1), (2, 3))  # along an edge
@example([(0, 0), (0, 2), (2, 2), (2, 0)], (3, 1), (1, 3))  # by a corner
@example([(0, 0), (0, 0), (4, 4), (4, 0), (0, 4)], (2, 1), (2, 3))  # where it crosses itself
def test_on_a_grid_ways_are_allowed_as_whole_numbers_say(
    corners: list[Node], start: Node, end: Node
) -> None:
    edges = list(zip(corners, [*corners[1:], corners[0]], strict=True))
    touches = any(meet(start, end, *edge) for edge in edges)
    ends = to_local(on_grid(start), ORIGIN), to_local(on_grid(end), ORIGIN)
    ring = tuple(on_grid(node) for node in corners)
    inner, outer = fence(Polygon(ring, is_inclusion=True)), fence(Polygon(ring, is_inclusion=False))
    assert inner.allows_way(*ends) == (not touches and is_within(start, corners))
    assert outer.allows_way(*ends) == (not touches and not is_within(start, corners))
