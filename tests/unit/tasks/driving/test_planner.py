"""Ways for a vehicle that steers as a car: they end where they should, and turn no tighter."""

from math import cos, hypot, pi, sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Bend, GlobalPlace, GoTo, LocalPlace, Pose
from mav_tasks.kinds.follow import Follow
from mav_tasks.kinds.guidance import Situation, bend_speed
from mav_tasks.kinds.path import (
    Path,
    beside,
    curvature_at,
    nearest,
    path_length,
    pose_on,
    runs_of,
    wrap,
)
from mav_tasks.tasks.driving.fence import Circle, Fence, LocalFence, Polygon
from mav_tasks.tasks.driving.frames import to_global
from mav_tasks.tasks.driving.planner import (
    SPARE,
    Steering,
    is_allowed,
    set_out_to,
    way_to,
    way_to_pose,
)
from mav_tasks.tasks.task import Progress
from tests.unit.tasks.samples import motion

RADIUS = 1.5
FORWARD_ONLY = Steering(RADIUS, reverses=False)
EARTH = GlobalPlace(473977420, 85455940)
HERE = Pose(0.0, 0.0, 0.0)

metres = st.floats(-20, 20)
angles = st.floats(-pi, pi)
poses = st.builds(Pose, metres, metres, angles)
places = st.builds(LocalPlace, metres, metres)


def end_of(pose: Pose, way: Path) -> Pose:
    for run in runs_of(way):
        pose = pose_on(pose, run, path_length(run))
    return pose


def is_drivable(way: Path, *, reverses: bool) -> bool:
    limit = 1 / (SPARE * RADIUS) + 1e-9
    return all(abs(b.curvature) <= limit and (reverses or b.length > 0) for b in way)


def yard(*corners: tuple[float, float]) -> LocalFence:
    zone = Polygon(tuple(to_global(LocalPlace(*c), EARTH) for c in corners), is_inclusion=True)
    return LocalFence(Fence((zone,)), EARTH)


def box(south: float, west: float, north: float, east: float) -> LocalFence:
    return yard((south, west), (south, east), (north, east), (north, west))


@given(poses, places, st.booleans())
def test_a_way_ends_at_its_place_and_turns_no_tighter_than_the_vehicle(
    pose: Pose, place: LocalPlace, reverses: bool
) -> None:
    way = way_to(pose, place, Steering(RADIUS, reverses))
    assert way is not None
    end = end_of(pose, way)
    assert hypot(end.north - place.north, end.east - place.east) < 2e-3
    assert is_drivable(way, reverses=reverses)
    assert way[-1].length > 0, "it comes to a place forwards"


@given(poses, poses, st.booleans())
def test_a_way_to_a_pose_ends_with_its_heading(pose: Pose, goal: Pose, reverses: bool) -> None:
    way = way_to_pose(pose, goal, Steering(RADIUS, reverses))
    assert way is not None
    end = end_of(pose, way)
    assert hypot(end.north - goal.north, end.east - goal.east) < 2e-3
    assert abs(wrap(end.yaw - goal.yaw)) < 2e-3
    assert is_drivable(way, reverses=reverses)
    assert len(runs_of(way)) == 1


def way(place: LocalPlace, steering: Steering) -> Path:
    found = way_to(HERE, place, steering)
    assert found is not None
    return found


def test_a_loop_that_leaves_the_fence_becomes_a_turn_with_reversing() -> None:
    alley, behind = box(-8.0, -1.6, 8.0, 1.6), LocalPlace(-6.0, 0.0)
    assert way_to(HERE, behind, Steering(RADIUS, reverses=False, fence=alley)) is None
    found = way(behind, Steering(RADIUS, reverses=True, fence=alley))
    assert len(runs_of(found)) > 1
    assert is_allowed(HERE, found, alley)


def test_a_bend_keeps_clear_of_the_fence_where_it_can() -> None:
    zone = Circle(to_global(LocalPlace(2.0, 1.725), EARTH), 0.1, is_inclusion=False)
    fence = LocalFence(Fence((zone,)), EARTH)
    place = LocalPlace(0.0, 5.0)
    bold = way(place, FORWARD_ONLY)
    careful = way(place, Steering(RADIUS, reverses=False, fence=fence))
    assert is_allowed(HERE, careful, fence, clear=0.3)
    assert not is_allowed(HERE, bold, fence, clear=0.3)
    assert is_allowed(HERE, bold, None)
    assert is_allowed(HERE, (Bend(0.0, 3.0),), box(1.0, -1.0, 9.0, 1.0)), "back in"
    assert set_out_to(GoTo(place), Progress(), HERE, LocalPlace(0.0, 0.0), FORWARD_ONLY).path


@given(poses, places, st.floats(0, 1), st.floats(-0.4, 0.4))
def test_a_vehicle_beside_its_path_is_found_on_it(
    pose: Pose, place: LocalPlace, share: float, right: float
) -> None:
    way = way_to(pose, place, FORWARD_ONLY)
    assert way is not None
    along = share * path_length(way)
    on = pose_on(pose, way, along)
    seen = Pose(on.north - right * sin(on.yaw), on.east + right * cos(on.yaw), on.yaw)
    found = nearest(pose, way, seen, around=along)
    there = pose_on(pose, way, found)
    assert hypot(there.north - seen.north, there.east - seen.east) <= abs(right) + 1e-9
    assert abs(beside(pose, way, seen, found)) <= abs(right) + 1e-9


def test_a_bend_slows_it_down_and_a_straight_before_it_does_not() -> None:
    driving, path = Driving(), (Bend(0.0, 9.0), Bend(0.5, 9.0))
    speeds = []
    for along in (1.0, 12.0):
        seen = motion(pose_on(HERE, path, along), at=1.0, forward=0.5)
        left = 18.0 - along
        now = Situation(HERE, seen, along, left, driving, radius=RADIUS, settles=False)
        speeds.append(Follow(path, 1.5).steer(now).forward)
    assert speeds == [1.5, pytest.approx(bend_speed(0.5, driving))]
    assert curvature_at(path, 99.0) == 0.0
