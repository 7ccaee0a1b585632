"""The server drives the pybullet rover: each leg measured from its own start, by the true pose."""

import math
from functools import partial

import pytest

from rover_sim.body import Body, BodyState, Pose
from rover_sim.bullet import BulletBody
from tests.kit.world import OFF, OFF_HEADING, OFF_WAY, World

pytestmark = pytest.mark.pybullet

FRICTION_VARIATION = 0.3  # either way
MOVE_TOLERANCE = OFF + 2.0 * OFF_WAY  # m, as it knows its place and its heading


def slippery(seed: int, start: Pose) -> Body:
    return BulletBody(start=start, variation=FRICTION_VARIATION, seed=seed)


@pytest.mark.parametrize("seed", range(1, 6))
def test_forward_and_rotate_end_where_they_should(seed: int) -> None:
    world = World(body=partial(slippery, seed)).ready()
    start = world.rover.truth
    world.client.move(2.0)
    world.until_idle(tasks=1, within=30)
    after_move = world.rover.truth
    assert along(start, after_move) == pytest.approx(2.0, abs=MOVE_TOLERANCE)
    assert abs(across(start, after_move)) < MOVE_TOLERANCE
    world.client.rotate(90)
    world.until_idle(tasks=2, within=30)
    assert turned(after_move, world.rover.truth) == pytest.approx(90, abs=OFF_HEADING)
    world.rover.body.close()
    world.check()


def along(start: BodyState, end: BodyState) -> float:
    north, east = end.north - start.north, end.east - start.east
    return north * math.cos(start.yaw) + east * math.sin(start.yaw)


def across(start: BodyState, end: BodyState) -> float:
    north, east = end.north - start.north, end.east - start.east
    return east * math.cos(start.yaw) - north * math.sin(start.yaw)


def turned(start: BodyState, end: BodyState) -> float:
    return math.degrees(math.remainder(end.yaw - start.yaw, math.tau))
