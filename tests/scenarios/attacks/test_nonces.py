"""Attack L1: a nonce that is drawn a second time must not swallow a task.

A nonce is there for the copies of one submission, which come within seconds. An equal submission
that happens to draw the nonce of a task long over is a task of its own, and is driven.
"""

import pytest

from mav_tasks.store import MemoryStore
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.restored import Restored
from tests.kit.cases import for_each
from tests.kit.world import World

NONCE = 5
KEPT = 600.0  # s after its end, in which a task is known by its nonce


def done(world: World) -> int:
    task = world.client.move(0.5, nonce=NONCE)
    world.run(0.2)
    world.until_state(task.task_id, S.COMPLETED)
    return task.task_id


def test_an_old_nonce_does_not_swallow_an_equal_task(world: World) -> None:
    first = done(world)
    world.run(KEPT + 1.0)
    before = world.truth.north
    assert done(world) == first + 1
    assert world.truth.north - before == pytest.approx(0.5, abs=0.05)


@pytest.mark.volume
@for_each("late", [20.0, KEPT - 30.0])
def test_a_late_copy_is_still_the_same_task(world: World, late: float) -> None:
    first = done(world)
    world.run(late)
    assert done(world) == first


@for_each("away, task_id", [(20.0, 1), (KEPT + 60.0, 2)])
def test_after_a_restart_too(world: World, away: float, task_id: int) -> None:
    assert done(world) == 1
    task = world.task(1)
    world.end_server()
    world.run(away)
    restored = Restored(tasks=(task,), next_id=2)
    world.start_server(MemoryStore(), restored)
    world.run(5.0)
    again = world.client.move(0.5, nonce=NONCE)
    world.run(0.2)
    assert again.task_id == task_id
