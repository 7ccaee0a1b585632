"""The rover in a test's hands: it shows the truth, and what is done to it really happens."""

from math import pi

import pytest

from rover_sim.testing.simulated_rover import SimulatedRover
from tests.unit.rover_sim.testing.conftest import MakeWorld


def pose(rover: SimulatedRover) -> tuple[float, ...]:
    return rover.north, rover.east, rover.heading


@pytest.mark.parametrize("body", ["kinematic", pytest.param("bullet", marks=pytest.mark.pybullet)])
def test_carried_elsewhere_it_drives_on_from_there(make_world: MakeWorld, body: str) -> None:
    world = make_world(body=body)
    (rover,) = world.rovers
    world.until(lambda: rover.mode != "initialising")
    rover.set_mode("manual")
    rover.arm()
    rover.hold_sticks(forward=1.0, yaw_rate=0.2)
    world.sleep(2)
    rover.place(north=100.0, east=-50.0, yaw=pi / 2)
    assert pose(rover) == pytest.approx((100.0, -50.0, 90.0))
    rover.hold_sticks(forward=1.0)
    world.sleep(0.5)
    heading, before = rover.heading, pose(rover)
    world.sleep(2)
    assert rover.heading == pytest.approx(heading, abs=2)
    assert rover.east - before[1] == pytest.approx(2.0, abs=0.1)  # to the east, where it looks
    rover.place(north=0.0)
    assert pose(rover)[0] == pytest.approx(0.0)
    assert rover.east - before[1] == pytest.approx(2.0, abs=0.1)
