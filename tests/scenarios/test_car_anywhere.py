"""A rover that steers as a car reaches whatever place it is sent to, also after an interruption."""

from functools import partial
from math import hypot
from random import Random

import pytest

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Persona
from tests.kit.car import Car
from tests.kit.mission import Item
from tests.kit.px4 import PROMPT_PX4, go_to
from tests.kit.volume import tries
from tests.kit.world import OFF_WAY, PROMPT, World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_car import RADIUS, car_profile, each
from tests.scenarios.test_fence import INCLUSION, box, fenced

HEAD, WAYPOINT, START = 213, 16, 300
NEAR = {"ardupilot": 0.13, "px4": 0.18}  # m; a PX4 is steered by course, in one try


def car(make_world: MakeWorld, persona: Persona, *, share: float = 1.0) -> World:
    settings = Settings(
        profiles=(car_profile(persona),), queueing=Queueing(preemption_gap=3, preemption_rest=0.3)
    )
    return make_world(
        persona=persona, settings=settings, body=partial(Car, radius=RADIUS, share=share)
    )


def off(world: World, north: float, east: float) -> float:
    return hypot(world.truth.north - north, world.truth.east - east)


@each
@pytest.mark.parametrize("share", [1.0, 0.5])  # well tuned, and ArduPilot's default gains
def test_every_place_is_reached(make_world: MakeWorld, persona: Persona, share: float) -> None:
    world, random = car(make_world, persona, share=share), Random(f"{persona.name} {share}")
    for number in range(1, 1 + tries(5, long=100)):
        reach = random.choice((2.0, 9.0))
        place = random.uniform(-reach, reach), random.uniform(-reach, reach)
        go_to(world, *place)
        world.until_idle(tasks=number, within=120)
        assert world.state(number) == (S.COMPLETED, R.NONE), place
        assert off(world, *place) <= NEAR[persona.name], place


def test_in_an_alley_it_turns_round_in_several_moves_and_one_that_cannot_says_so(
    make_world: MakeWorld,
) -> None:
    world = car(make_world, PROMPT)
    assert fenced(world, *box(INCLUSION, -10, -2.2, 10, 2.2)) == 0
    seen = []
    world.watch(lambda _now: seen.append((world.truth.forward_speed, abs(world.truth.east))))
    go_to(world, -6.0, 0.0)
    world.until_idle(tasks=1, within=120)
    assert world.state(1)[0] is S.COMPLETED
    assert off(world, -6.0, 0.0) <= 0.1
    speeds, asides = zip(*seen, strict=True)
    assert min(speeds) < -0.2
    assert max(asides) < 2.2

    world = car(make_world, PROMPT_PX4)
    assert fenced(world, *box(INCLUSION, -10, -1, 10, 1)) == 0
    go_to(world, -6.0, 0.0)
    world.until_idle(tasks=1)
    assert world.state(1) == (S.FAILED, R.OUTSIDE_FENCE)
    assert off(world, 0.0, 0.0) < 0.01


@each
def test_a_move_that_was_interrupted_ends_where_it_would_have_ended(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = car(make_world, persona)
    world.client.move(8.0, priority=1)
    world.until(lambda: world.truth.north > 2.0, within=30)
    turn = world.client.command(HEAD, 120, 0.5, 0, 0, 0, 6, 9)
    world.until_state(2, S.COMPLETED)
    assert turn.task_id == 2
    assert off(world, 8.0, 0.0) > 3.0
    world.until_idle(tasks=2, within=120)
    assert off(world, 8.0, 0.0) <= NEAR[persona.name] + 8.0 * OFF_WAY
    assert abs(world.pose()[2]) < 5


@each
def test_corners_are_passed_without_stopping_and_slowly_enough(
    make_world: MakeWorld, persona: Persona
) -> None:
    world = car(make_world, persona)
    corners = (8.0, 0.0), (8.0, 8.0), (0.0, 8.0), (0.0, 1.0)
    home = [Item(WAYPOINT, frame=0, current=1)] if persona is PROMPT else []
    world.upload(home + [Item(WAYPOINT, **at(*corner)) for corner in corners])
    nearest, slowest = [99.0] * len(corners), 99.0
    world.client.command(START, target=(1, 1))
    world.until_faster(0.4)
    while world.state(1)[0] is S.EXECUTING:
        world.run(0.05)
        nearest = [min(n, off(world, *c)) for n, c in zip(nearest, corners, strict=True)]
        if nearest[2] > 0.55:  # on the way to the last but one
            slowest = min(slowest, world.truth.forward_speed)
    assert world.state(1)[0] is S.COMPLETED
    assert max(nearest) <= 0.55  # acceptance radius 0.5 m
    assert slowest > 0.3
