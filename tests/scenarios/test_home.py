"""One home: what the rover says is home, a ground station shows it, and a return drives there."""

from math import hypot, nan
from pathlib import Path

from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.mission import Item
from tests.kit.px4 import PROMPT_PX4
from tests.kit.restarts import restart
from tests.kit.store import PromptSqliteStore
from tests.kit.world import PROMPT, World, at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, RETURN, SET_HOME = 16, 20, 179
NEAR = 0.2  # m
HERE = Item(SET_HOME, frame=2, param1=1)

both = for_each("persona", [PROMPT, PROMPT_PX4])


def far_from(world: World, north: float, east: float) -> float:
    return hypot(world.truth.north - north, world.truth.east - east)


def go_home(world: World, *, tasks: int) -> None:
    """Return, and be where a ground station shows home."""
    world.client.command(RETURN, target=(1, 1))
    world.until_idle(tasks=tasks)
    assert world.state(tasks)[0] is S.COMPLETED
    world.run(2.1)
    shown = world.client.of_type("HOME_POSITION")[-1]
    assert far_from(world, shown.x, shown.y) < NEAR


def drive(world: World, *places: tuple[float, float] | Item) -> None:
    """Drive a plan, armed by the operator and left armed."""
    items = [each if isinstance(each, Item) else Item(WAYPOINT, **at(*each)) for each in places]
    assert world.upload(items, target=(1, 191)).result == 0


def arm(world: World) -> None:
    world.client.arm()
    world.until(lambda: world.is_armed, within=3)
    world.run(1.0)


def make(make_world: MakeWorld, persona: Persona, path: Path) -> World:
    """A rover that has driven to (3, 0) and was disarmed there."""
    world = make_world(persona=persona, store=PromptSqliteStore(path, wall_offset=1.8e9))
    for number in (1, 2):
        world.client.move(1.5)
        world.until_idle(tasks=number)
    assert far_from(world, 3.0, 0.0) < NEAR
    world.until(lambda: not world.is_armed, within=10)
    return world


def test_a_return_at_once_after_the_arming_knows_the_new_home(
    make_world: MakeWorld, path: Path
) -> None:
    world = make(make_world, PROMPT, path)
    world.run(1.1)  # ArduPilot looks each second; the server was told of a home at (0, 0)
    world.client.command(RETURN, target=(1, 1))
    world.run(15)
    assert world.is_idle(tasks=3)
    assert far_from(world, 3.0, 0.0) < NEAR


@for_each("phase", [0.0, 1.6])
def test_a_return_begins_nowhere_before_the_home_of_its_arming_is_known(
    make_world: MakeWorld, phase: float
) -> None:
    """A PX4 sets home at the arming, and says where only when it is asked, or each 2 s."""
    world = make_world(persona=PROMPT_PX4)
    world.client.move(0.8)
    world.until_idle(tasks=1)
    world.until(lambda: not world.is_armed, within=10)
    world.run(1.0 + phase)
    world.client.command(RETURN, target=(1, 1))
    farthest = 0.0
    for _ in range(80):
        world.run(0.1)
        farthest = max(farthest, far_from(world, 0.8, 0.0))
    assert world.is_idle(tasks=2)
    assert farthest < NEAR


@both
@for_each("place", [None, (1.0, 3.0)])
def test_a_plan_sets_the_home_that_its_return_drives_to(
    make_world: MakeWorld, persona: Persona, path: Path, place: tuple[float, float] | None
) -> None:
    world = make(make_world, persona, path)
    item = HERE if place is None else Item(SET_HOME, frame=0, **at(*place))
    drive(world, (4.0, 1.0), item, Item(RETURN))
    world.until_idle(tasks=3)
    assert far_from(world, *(place or (4.0, 1.0))) < NEAR


@both
def test_a_client_sets_home_and_it_lasts_over_arming_and_the_server(
    make_world: MakeWorld, persona: Persona, path: Path
) -> None:
    world = make(make_world, persona, path)
    world.client.command_int(SET_HOME, 0, 0, 0, nan, **at(2.0, 1.0), frame=0, target=(1, 1))
    world.client.command(RETURN, target=(1, 1))  # before it is acknowledged
    world.until_idle(tasks=3)
    assert far_from(world, 2.0, 1.0) < NEAR
    world.client.move(1.0)
    world.until_idle(tasks=4)
    restart(world, path, well=True)
    go_home(world, tasks=5)
    assert far_from(world, 2.0, 1.0) < NEAR
