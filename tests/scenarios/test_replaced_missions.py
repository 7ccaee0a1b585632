"""The autopilot's address has one mission: what drives is what was uploaded last, as on it."""

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.cases import anew, for_each
from tests.kit.client import AUTO, HOLD
from tests.kit.mission import Item
from tests.kit.observer import ARDUPILOT_WAYS
from tests.kit.px4 import HOLD as PX4_HOLD
from tests.kit.px4 import MISSION, PROMPT_PX4, ask_mode
from tests.kit.world import PROMPT, World, at, is_at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, MISSION_START = 16, 300


@anew
def world(make_world: MakeWorld, persona: Persona) -> World:
    """A rover that drives the first mission, northwards, in sight of a stock client."""
    world = make_world(persona=persona)
    world.client.reads_dialect = False
    upload(world, 3.0, 6.0)
    start(world)
    world.until(lambda: world.truth.north > 0.5, within=20)
    return world


def is_ardupilot(world: World) -> bool:
    return world.observer.ways is ARDUPILOT_WAYS


def upload(world: World, *norths: float) -> None:
    home = [Item(WAYPOINT, **at(0, 0))] if is_ardupilot(world) else []
    assert world.upload([*home, *(Item(WAYPOINT, **at(n, 0.0)) for n in norths)]).result == 0


def start(world: World) -> None:
    world.client.arm()
    world.run(0.3)
    ask(world, AUTO, MISSION)


def ask(world: World, ardupilot: int, px4: int) -> None:
    if is_ardupilot(world):
        world.client.mode(ardupilot)
    else:
        ask_mode(world.client, px4)


@for_each("persona", [PROMPT, PROMPT_PX4])
@for_each("halt", ["HOLD", "pause"])
@for_each("by", ["mode", "MISSION_START"])
def test_paused_edited_uploaded_and_started(world: World, halt: str, by: str) -> None:
    if halt == "pause":
        world.client.pause(target=(1, 1))
    else:
        ask(world, HOLD, PX4_HOLD)
    world.until(world.stands, within=10)
    world.run(1)
    upload(world, -2.0)
    assert world.state(1) == (S.CANCELLED, R.REPLACED), "nobody finds it in the queue later"
    where = world.truth.north
    world.run(2)
    assert abs(world.truth.north - where) < 0.05, "an upload moves nothing"
    if by == "mode":
        ask(world, AUTO, MISSION)
    else:
        world.client.command(MISSION_START, target=(1, 1))
    world.until(lambda: world.state(2)[0] is S.COMPLETED, within=60)
    assert is_at(world, -2.0, 0.0)
    assert world.paused() is R.NONE, "nothing waits, and who paused it has started it"
    world.client.proceed()
    world.run(5)
    assert is_at(world, -2.0, 0.0)
