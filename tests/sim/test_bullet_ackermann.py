"""The pybullet rover with two steered front wheels: it rolls on arcs, and only there."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from math import degrees, radians, remainder

import pytest

from rover_sim.ackermann import AckermannBody
from rover_sim.body import Body, BodyState, Pose
from rover_sim.bullet import BulletBody
from rover_sim.frames import TURN_RADIUS, Frame

pytestmark = pytest.mark.skipif(find_spec("pybullet") is None, reason="needs pybullet")

BODIES: dict[str, Callable[[], Body]] = {
    "bullet": lambda: BulletBody(start=Pose(), frame=Frame.ACKERMANN),
    "kinematic": lambda: AckermannBody(start=Pose(), seed=None),
}


@contextmanager
def driven(name: str, speed: float, rate: float, seconds: float) -> Iterator[list[BodyState]]:
    body = BODIES[name]()
    try:
        body.drive(speed, rate)
        states = []
        for _ in range(round(seconds * 40)):
            body.advance(0.025)
            states.append(body.state)
        yield states
    finally:
        body.close()


@pytest.mark.parametrize("name", BODIES)
def test_straight_ahead_is_straight(name: str) -> None:
    with driven(name, 1.0, 0.0, 5.0) as states:
        assert states[-1].north == pytest.approx(4.95, abs=0.1)
        assert abs(states[-1].east) < 0.02
        assert abs(degrees(states[-1].yaw)) < 0.2


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("rate", [0.5, -0.5])
@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_it_turns_as_is_asked_for_while_it_rolls(name: str, rate: float, speed: float) -> None:
    with driven(name, speed, rate, 4.0) as states:
        assert states[-1].yaw_rate == pytest.approx(rate, rel=0.03)
        assert states[-1].forward_speed == pytest.approx(speed, rel=0.02)


@pytest.mark.parametrize("name", BODIES)
def test_it_does_not_turn_on_the_spot(name: str) -> None:
    with driven(name, 0.0, radians(90), 3.0) as states:
        end = states[-1]
        assert abs(degrees(end.yaw)) < 0.5
        assert abs(end.north) + abs(end.east) < 0.01


@pytest.mark.parametrize("name", BODIES)
def test_no_turn_is_tighter_than_full_lock(name: str) -> None:
    with driven(name, 0.5, 3.0, 8.0) as states:
        assert 0.5 / states[-1].yaw_rate == pytest.approx(TURN_RADIUS, rel=0.05)


@pytest.mark.parametrize("name", BODIES)
def test_it_has_turned_where_its_wheels_had_time_to_turn(name: str) -> None:
    """The servo takes 0.08 s to full lock: the first rate is not the last one."""
    with driven(name, 1.0, 1.0, 4.0) as states:
        turned = remainder(states[-1].yaw, 2 * 3.141592653589793)
        assert degrees(turned) == pytest.approx(degrees(1.0 * 4.0) - 360.0, abs=12.0)
