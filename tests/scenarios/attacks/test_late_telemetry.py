"""Telemetry that comes late: what lay in a radio's buffer for two seconds is two seconds old.

Attack D5: a fence of 40 m was left by 5.5 m with a delay that grew to 4 s, one of 15 m by 1.3 m
with 2 s; by way of a radio of 57,600 baud an observer caused it by raising rates.
"""

from collections.abc import Callable

import pytest

from mav_tasks.config.settings import Driving, Settings
from mav_tasks.links.memory import Queue
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.client import DRIVE
from tests.kit.mission import Item
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import OFF, PROMPT, World, at
from tests.scenarios.conftest import MakeWorld

FENCE, CORNER = 1, 5001
DOWN = ("rover1", VEHICLE_LINK)
BRISK = Settings(driving=Driving(acceleration=1.0))

Delay = Callable[[float], float]


def fenced(world: World, reach: float) -> None:
    """Draw a square of so many metres to each side about the rover."""
    places = [(-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach)]
    items = [Item(CORNER, **at(*p), param1=4, param4=0, frame=0) for p in places]
    assert world.upload(items, kind=FENCE).result == 0


def drive_at(world: World, speed: float, *, seconds: float) -> float:
    """Drive towards the fence; gives how far the rover really gets."""
    world.client.command(DRIVE, speed, 0, 300, 0, 0, 0, 5, repeats=(0.0, 0.5, 1.0, 1.5))
    farthest, end = 0.0, world.now + seconds
    while world.now < end:
        world.run(0.05)
        farthest = max(farthest, abs(world.truth.north), abs(world.truth.east))
    assert world.stands()
    return farthest


GROWS: dict[str, Delay] = {
    "at once": lambda s: 4.0 if s > 0 else 0.0,
    "in 4 s": lambda s: min(4.0, max(0.0, s)),
    "in 40 s": lambda s: min(4.0, max(0.0, 0.1 * s)),
    "in 80 s": lambda s: min(4.0, max(0.0, 0.05 * s)),
    "and shrinks": lambda s: max(0.0, 2.0 - abs(2.0 - s % 10)) if s > 0 else 0.0,
}


@for_each("growth", GROWS)
@for_each("persona", [PROMPT, PROMPT_PX4])
def test_a_delay_that_grows_leads_nobody_over_a_fence(
    make_world: MakeWorld, persona: Persona, growth: str
) -> None:
    world = make_world(settings=BRISK, persona=persona)
    fenced(world, 40)
    begin = world.now + 8.0
    world.net.buffers[DOWN] = Queue(lambda now: GROWS[growth](now - begin))
    reached = drive_at(world, 2.0, seconds=90)
    print(f"{growth}: reached {reached:.3f} m of 40 m")
    assert 2 < reached < 40 + OFF


def test_what_comes_in_time_again_drives_on_to_the_exact_end(make_world: MakeWorld) -> None:
    world = make_world()
    world.client.move(4)
    world.until_faster(0.4)
    begin = world.now
    world.net.buffers[DOWN] = Queue(lambda now: 2.0 if now < begin + 5 else 0.0)
    world.run(2.5)
    assert world.stands()
    assert world.state(1) == (S.PAUSED, R.POSITION_LOST)
    world.until_state(1, S.COMPLETED, within=40)
    assert world.truth.north == pytest.approx(4.0, abs=OFF)
