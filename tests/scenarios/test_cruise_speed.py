"""A stock client's mission or "go to" without a speed is driven at the rover's own."""

from math import nan

import pytest

from mav_tasks.config.settings import Driving, Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

REPOSITION, CHANGE_SPEED = 192, 178
FAR = 20.0  # m


def cruising(make_world: MakeWorld, cruise: float, *, fastest: float = 2.0) -> World:
    world = make_world(settings=Settings(driving=Driving(max_speed=fastest)))
    world.rover.autopilot.parameters["CRUISE_SPEED"] = cruise
    world.rover.autopilot.reboot(now=world.now)  # it is asked anew
    world.run(8)
    return world


def goes(world: World, *, speed: float = -1.0, target: tuple[int, int] = (1, 1)) -> None:
    world.client.command_int(REPOSITION, speed, 1, 0, nan, **at(FAR, 0), frame=0, target=target)
    world.run(0.2)


def top_speed(world: World) -> float:
    world.until_state(len(world.tasks()), S.EXECUTING, within=10)
    fastest = 0.0
    for _ in range(120):
        world.run(0.1)
        fastest = max(fastest, world.truth.forward_speed)
    return fastest


@for_each("cruise, fastest, driven", [(1.2, 2.0, 1.2), (5.0, 1.5, 1.5), (0.0, 2.0, 2.0)])
def test_a_go_to_is_driven_at_the_rovers_speed_within_the_bounds(
    make_world: MakeWorld, cruise: float, fastest: float, driven: float
) -> None:
    """The simulated rover's WP_SPEED is 5; CRUISE_SPEED 0 is none."""
    world = cruising(make_world, cruise, fastest=fastest)
    goes(world)
    assert top_speed(world) == pytest.approx(driven, abs=0.15)


@for_each("what", ["named", "changed", "at the task server", "of our own"])
def test_other_tasks_keep_their_speed(make_world: MakeWorld, what: str) -> None:
    world = cruising(make_world, 1.2)
    match what:
        case "named":
            goes(world, speed=0.5)
        case "changed":
            world.client.command(CHANGE_SPEED, 1, 0.5, -1, target=(1, 1))
            world.run(0.2)
            goes(world)
        case "at the task server":
            goes(world, target=(1, 191))
        case _:
            world.client.move(FAR)
            world.run(0.2)
    assert top_speed(world) == pytest.approx(0.5, abs=0.15)
