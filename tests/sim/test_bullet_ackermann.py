"""The pybullet rover with two steered front wheels: it rolls on arcs, and only there."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import degrees, radians

import pytest

from rover_sim.ackermann import AckermannBody
from rover_sim.body import Body, BodyState, Pose
from rover_sim.bullet import BulletBody
from rover_sim.frames import TURN_RADIUS, Frame

pytestmark = pytest.mark.pybullet

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


def test_it_turns_as_is_asked_for_while_it_rolls() -> None:
    for name in BODIES:
        for rate in [0.5, -0.5]:
            for speed in [1.0, -1.0]:
                with driven(name, speed, rate, 4.0) as states:
                    assert states[-1].yaw_rate == pytest.approx(rate, rel=0.03)
                    assert states[-1].forward_speed == pytest.approx(speed, rel=0.02)


def test_it_does_not_turn_on_the_spot() -> None:
    for name in BODIES:
        with driven(name, 0.0, radians(90), 3.0) as states:
            end = states[-1]
            assert abs(degrees(end.yaw)) < 0.5
            assert abs(end.north) + abs(end.east) < 0.01


def test_no_turn_is_tighter_than_full_lock() -> None:
    for name in BODIES:
        with driven(name, 0.5, 3.0, 8.0) as states:
            assert 0.5 / states[-1].yaw_rate == pytest.approx(TURN_RADIUS, rel=0.05)
