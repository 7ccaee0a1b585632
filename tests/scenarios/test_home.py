"""Where a rover returns to: where it was first armed, or where somebody has put its home."""

from math import hypot, nan
from pathlib import Path

import pytest

from mav_tasks.tasks.events import VehicleHomeSet
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.px4 import PROMPT_PX4
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_restart import restart

RETURN, SET_HOME = 20, 179
NEAR = 0.2  # m


def far_from(world: World, north: float, east: float) -> float:
    return hypot(world.truth.north - north, world.truth.east - east)


def go_home(world: World, *, tasks: int) -> None:
    world.client.command(RETURN, target=(1, 1))
    world.until_idle(tasks=tasks)
    assert world.state(tasks)[0] is S.COMPLETED


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


@pytest.fixture
def world(make_world: MakeWorld, path: Path) -> World:
    """A PX4, which says at each arming that home is where it is, after two moves."""
    world = make_world(persona=PROMPT_PX4, store=PromptSqliteStore(path, wall_offset=1.8e9))
    for number in (1, 2):
        world.client.move(1.5)
        world.until_idle(tasks=number)
    assert far_from(world, 3.0, 0.0) < NEAR
    return world


def test_a_return_drives_to_where_it_was_first_armed(world: World) -> None:
    go_home(world, tasks=3)
    assert far_from(world, 0.0, 0.0) < NEAR
    assert len(world.events(VehicleHomeSet)) == 1


def test_home_is_kept_over_a_restart_of_the_server(world: World, path: Path) -> None:
    restart(world, path, well=True)
    go_home(world, tasks=3)
    assert far_from(world, 0.0, 0.0) < NEAR


def test_home_is_where_a_client_has_put_it(world: World) -> None:
    place = at(2.0, 1.0)
    world.client.command_int(SET_HOME, 0, 0, 0, nan, **place, frame=0, target=(1, 1))
    world.run(0.5)
    go_home(world, tasks=3)
    assert far_from(world, 2.0, 1.0) < NEAR


def test_home_is_put_where_the_rover_is(world: World) -> None:
    world.client.command(SET_HOME, 1, target=(1, 1))
    world.run(0.5)
    world.client.move(1.0)
    world.until_idle(tasks=3)
    go_home(world, tasks=4)
    assert far_from(world, 3.0, 0.0) < NEAR


def test_one_that_has_booted_again_has_the_home_of_its_next_first_arming(world: World) -> None:
    world.run(20)  # longer than two estimates of when it booted may differ
    world.rover.autopilot.reboot(now=world.now)
    world.run(10)
    world.client.move(1.0)
    world.until_idle(tasks=3)
    go_home(world, tasks=4)
    assert far_from(world, 3.0, 0.0) < NEAR


def test_one_that_is_met_armed_has_said_where_that_was(make_world: MakeWorld) -> None:
    world = make_world(persona=PROMPT_PX4)
    world.operator_arm(True)
    world.run(2)
    assert world.events(VehicleHomeSet)
