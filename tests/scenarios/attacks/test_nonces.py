"""Attack L1: a nonce that is drawn a second time must not swallow a task.

A nonce is there for the copies of one submission, which come within seconds. An equal submission
that happens to draw the nonce of a task long over is a task of its own, and is driven.
"""

from random import Random

import pytest

from mav_tasks.client import submissions
from mav_tasks.store import MemoryStore
from mav_tasks.tasks.deduplicator import SubmissionDeduplicator
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Draft, Marks, Submitter, TaskId
from tests.kit.world import World

NONCE = 5
KEPT = 600.0  # s after its end, in which a task is known by its nonce
SUBMISSIONS = 100_000
EACH = 3.0  # s from one submission to the next: three and a half days of them
DRIVES = 60.0  # s that a task takes, waiting for others included


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
def test_an_old_nonce_does_not_refuse_another_task(world: World) -> None:
    done(world)
    world.run(KEPT + 1.0)
    other = world.client.rotate(10, nonce=NONCE)
    world.run(0.2)
    assert other.task_id == 2


@pytest.mark.volume
@pytest.mark.parametrize("late", [20.0, KEPT - 30.0])
def test_a_late_copy_is_still_the_same_task(world: World, late: float) -> None:
    first = done(world)
    world.run(late)
    assert done(world) == first


@pytest.mark.parametrize(("away", "task_id"), [(20.0, 1), (KEPT + 60.0, 2)])
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


@pytest.mark.volume
def test_of_100000_equal_submissions_none_is_taken_for_an_old_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each from a process of its own, all of one address: the worst case of the draw."""
    random = Random(17)
    monkeypatch.setattr(submissions, "SystemRandom", lambda: random)
    registry = TaskRegistry()
    memory = SubmissionDeduplicator(registry)
    somebody = Submitter("udp", "127.0.0.1:1", 244, 190)
    driving: list[tuple[float, TaskId]] = []
    swallowed = 0
    for number in range(SUBMISSIONS):
        now = number * EACH
        while driving and driving[0][0] <= now:
            ended, task_id = driving.pop(0)
            why = TaskReason.CANCELLED
            registry.change(task_id, S.CANCELLED, reason=why, actor="", now=ended)
            registry.take_events()
        marks = Marks(submissions.Submissions().nonce(), "equal", "")
        draft = Draft(1, 54000, Move(1.0), somebody, marks=marks)
        if memory.known(draft, confirmation=0, origin=None, now=now) is not None:
            swallowed += 1
            continue
        task = registry.submit(draft, now=now)
        memory.remember(task, at=now, now=now)
        driving.append((now + DRIVES, task.id))
    assert swallowed == 0
