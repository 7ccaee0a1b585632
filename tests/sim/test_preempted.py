"""On slipping wheels, too, an interrupted task ends where it would have ended."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import hypot
from typing import Any

import pytest

from mav_tasks.settings import Queueing, Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.bullet import BulletBody
from tests.kit.world import World, near_pose

pytestmark = pytest.mark.pybullet

GAP = Settings(queueing=Queueing(preemption_gap=3, preemption_rest=0.3))


@contextmanager
def driven(seed: int) -> Iterator[World]:
    """A world on varied ground, checked in the end."""
    world = World(
        body=lambda start: BulletBody(start=start, variation=0.3, seed=seed), settings=GAP
    ).ready()
    yield world
    world.rover.body.close()
    world.check()


def end_of(seed: int, submit: Callable[[World], object], *others: Callable[[World], object]) -> Any:
    """Where a task ends, with others that interrupt it after a while, or without."""
    with driven(seed) as world:
        submit(world)
        world.run(3.0)
        for other in others:
            other(world)
            world.run(0.1)
        world.until_idle(tasks=1 + len(others), within=120)
        assert [task.state for task in world.tasks()] == [S.COMPLETED] * (1 + len(others))
        return world.pose()


def test_a_move_interrupted_by_a_turn_and_another_move() -> None:
    for seed in [1, 2, 3]:

        def move(world: World) -> object:
            return world.client.move(3.0, priority=2)

        interrupted = end_of(
            seed,
            move,
            lambda world: world.client.rotate(120, priority=8),
            lambda world: world.client.move(0.6, priority=7),
        )
        assert near_pose(interrupted, end_of(seed, move), metres=0.03, angle=1.5)


def test_a_turn_interrupted_by_a_move() -> None:
    for seed in [4, 5]:

        def turn(world: World) -> object:
            return world.client.rotate(150, priority=2)

        interrupted = end_of(seed, turn, lambda world: world.client.move(-0.5, priority=8))
        undisturbed = end_of(seed, turn)
        # On ground like this a turn alone leaves its spot by some centimetres; interrupted, by no more.
        assert hypot(*interrupted[:2]) <= hypot(*undisturbed[:2]) + 0.03
        assert abs(interrupted[2] - undisturbed[2]) < 1.5
