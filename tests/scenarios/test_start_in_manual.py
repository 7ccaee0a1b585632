"""The usual script: upload, arm in a manual mode, ask for the mission at once. It starts.

The heartbeat that shows the arming, its acknowledgement, the store's answer and the request for the
mission come in any order.
"""

from typing import NamedTuple

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, AUTO, Sent
from tests.kit.mission import Item
from tests.kit.px4 import MISSION, ask_mode
from tests.kit.store import LateStore
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

WAYPOINT = 16


class Case(NamedTuple):
    """What comes late, s."""

    delay: float = 0.001  # of each link
    commit: float = 0.0  # of the store
    phase: float = 0.0  # of the first request, after a heartbeat
    gap: float = 0.0  # between both requests
    shows: bool = True  # the rover sends heartbeats on request, not each second alone


STORE_LATE = Case(commit=0.3)
SHOWN_LATE = Case(commit=0.3, phase=0.8, shows=False)
LINK_LATE = Case(delay=0.1, phase=0.8, gap=0.3, shows=False)  # shown more than 2 s after


def ready(make_world: MakeWorld, persona: Persona, case: Case) -> World:
    """Return a world with a mission, whose rover is in a manual mode."""
    store = LateStore()
    world = make_world(persona=persona, shows_on_request=case.shows, store=store)
    world.client.reads_dialect = False
    assert world.upload([Item(WAYPOINT, **at(north, 0.0)) for north in (0.0, 2.0, 4.0)]).result == 0
    world.operator_mode(Mode.MANUAL)
    world.run(2.5)
    store.delay, world.net.conditions = case.commit, Conditions(delay=case.delay)
    world.until(lambda: world.now % 1.0 < 0.02, within=1.1)
    world.run(case.phase)
    return world


def ask_for_mission(world: World, persona: Persona) -> Sent:
    if persona is PX4:
        return ask_mode(world.client, MISSION)
    return world.client.mode(AUTO)


@for_each(
    "persona, case",
    [
        (ARDUPILOT, STORE_LATE),
        (ARDUPILOT, SHOWN_LATE),
        (ARDUPILOT, LINK_LATE),
        (PX4, LINK_LATE),
    ],
)
@for_each("arms_first", [True, False])
def test_a_mission_that_was_accepted_starts(
    make_world: MakeWorld, persona: Persona, case: Case, *, arms_first: bool
) -> None:
    world = ready(make_world, persona, case)
    if arms_first:
        world.client.arm()
    else:
        asked = ask_for_mission(world, persona)
    world.run(case.gap)
    if arms_first:
        asked = ask_for_mission(world, persona)
    else:
        world.client.arm()
    world.until(lambda: asked.answer is not None, within=2)
    assert asked.result == ACCEPTED
    world.until_state(1, S.EXECUTING, within=8)
