"""TASK_STATUS says how much of the whole task is done, by time, and never less than before."""

from math import hypot, nan

import pytest

from tests.kit.client import ACCEPTED
from tests.kit.mission import Item
from tests.kit.world import World, at

REPOSITION, START, WAYPOINT = 192, 300, 16


def watch(world: World, task_id: int) -> list[tuple[int, float, tuple[float, float]]]:
    """Drive a task to its end; return its progress, what is left of it, and the true place."""
    told = []
    while task_id not in [task.id for task in world.tasks() if task.state.name == "COMPLETED"]:
        world.client.request_status(task_id)
        world.run(0.5)
        status = world.client.statuses(task_id)[-1]
        told.append((status.progress, status.remaining, world.pose()[:2]))
        assert len(told) < 200
    return told


def test_a_go_to_behind_it_is_not_half_done_after_the_turn(world: World) -> None:
    sent = world.client.command_int(REPOSITION, -1, 0, 0, nan, frame=0, **at(-6.0, 0.0))
    world.run(0.2)
    assert sent.result == ACCEPTED
    told = watch(world, 1)
    shares = [share for share, _, _ in told]
    assert shares == sorted(shares)
    for share, left, here in told[:-4]:
        way = hypot(here[0] + 6.0, here[1])
        if share:
            assert left == pytest.approx(way, abs=0.4), "all of the way, in metres"
        if way > 5.5:
            assert share < 35, "it has only turned"
    half = next(share for share, _, here in told if here[0] < -3.0)
    assert 50 <= half <= 75


def test_a_plan_counts_by_its_way_and_not_by_its_items(world: World) -> None:
    plan = [Item(WAYPOINT, **at(n, 0.0)) for n in (0.0, 0.5, 1.0, 1.5, 8.0)]
    world.upload(plan)
    world.client.command(START, target=(1, 1))
    world.run(0.2)
    told = watch(world, 1)
    shares = [share for share, _, _ in told]
    assert shares == sorted(shares)
    half = next(share for share, _, here in told if here[0] > 4.0)
    assert 35 <= half <= 65
