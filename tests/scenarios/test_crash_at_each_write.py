"""The server is killed at each event that it stores, before or after it has said so to anybody.

Whatever the point: no acknowledged task is lost and none is there twice; what ran is held, and the
rover in HOLD; nothing moves before somebody says so; an acknowledged STOP and pause are in force.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from mav_tasks.engine.inputs import Committed, HaltsKept
from mav_tasks.store import MemoryStore, Outcome
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.client import ACCEPTED, STOP, Sent
from tests.kit.store import PromptSqliteStore
from tests.kit.volume import some
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

UTC = 1.8e9  # s, when the worlds begin
STOP_TIME = 6.0  # s, an abandoned rover's own time-out and its way to a stand
CANCEL, MODIFY, SPEED = 54010, 54012, 178
ENDS = 45.0  # s, of the story
#: when somebody sends a command, and which: submissions have nonces
STORY: dict[float, Callable[[World], Sent]] = {
    0.1: lambda world: world.client.move(0.5, nonce=1),
    0.3: lambda world: world.client.rotate(20, nonce=2),
    0.5: lambda world: world.client.command(54000, 0.3, 0, 0, 3, 2, 1.0, 5),  # after task 2
    0.7: lambda world: world.client.command(MODIFY, 2, 1, 9),
    0.9: lambda world: world.client.command(SPEED, 1, 0.8, -1),
    16.0: lambda world: world.client.move(30, nonce=4),
    18.0: lambda world: world.client.pause(),
    21.0: lambda world: world.client.proceed(),
    24.0: lambda world: world.client.command(CANCEL, 0),
    29.0: lambda world: world.client.move(30, nonce=5),
    31.0: lambda world: world.client.rotate(90, nonce=6),
    33.0: lambda world: world.client.stop(),
}


class Crashing(MemoryStore):
    """Keeps so many events; it tells of the last one only if ``reports``."""

    def __init__(self, last: int, *, reports: bool) -> None:
        super().__init__()
        self.last, self.reports = last, reports
        self.told = 0

    @property
    def is_over(self) -> bool:
        return len(self.events) >= self.last

    def take_outcomes(self) -> list[Outcome]:
        through = min(len(self.events), self.last if self.reports else self.last - 1)
        if through <= self.told:
            return []
        self.told = through
        return [HaltsKept(through), Committed(through)]


def live(world: World, store: Crashing) -> list[Sent]:
    """Let the story happen until the crash; return what was sent."""
    began, sent = world.now, list[Sent]()
    for at, send in STORY.items():
        while world.now < began + at and not store.is_over:
            world.run(0.05)
        if store.is_over:
            return sent
        sent.append(send(world))
    while world.now < began + ENDS and not store.is_over:
        world.run(0.05)
    return sent


def left_by(store: Crashing, path: Path) -> PromptSqliteStore:
    """Return a store with what is durable."""
    disk = PromptSqliteStore(path, wall_offset=UTC)
    disk.append(store.events[: store.last])
    disk.take_outcomes()
    disk.close()
    return PromptSqliteStore(path, wall_offset=UTC)


EVENTS = 48  # of the whole story


@pytest.mark.parametrize("last", some(range(1, EVENTS), *range(0, EVENTS - 1, 3)))
def test_killed_at_any_write(make_world: MakeWorld, tmp_path: Path, last: int) -> None:
    store = Crashing(last, reports=last % 2 == 0)
    world = make_world(store=store)
    sent = live(world, store)
    world.run(0.1)  # answers under way arrive
    world.end_server()
    world.run(STOP_TIME)
    where = world.pose()
    later = left_by(store, tmp_path / "tasks.sqlite3")
    world.start_server(later, replace(later.load(), ended_well=False))
    world.run(4.0)

    assert store.is_over, f"the story has {len(store.events)} events"
    tasks = {task.id: task for task in world.tasks()}
    nonces = [task.marks.nonce for task in tasks.values()]
    assert len(nonces) == len(set(nonces)), "a task is there twice"
    answered = {each.message.param4: each for each in sent if each.result == ACCEPTED}
    for nonce in set(answered) & set(range(1, 7)):
        assert answered[nonce].task_id in tasks, "an acknowledged task is lost"
    assert not {S.STARTING, S.CANCELLING} & {task.state for task in tasks.values()}
    held = [task for task in tasks.values() if task.state is S.HELD]
    assert {task.reason for task in held} <= {R.OUTCOME_UNKNOWN}
    halts = [each for each in sent if each.result == ACCEPTED]
    if halts and halts[-1].message.command == STOP:
        assert world.paused() is R.STOPPED
    if held or world.paused():
        was_driven = held or [task for task in tasks.values() if task.state is S.PAUSED]
        modes = {Mode.HOLD} if was_driven else {Mode.HOLD, Mode.MANUAL}
        assert world.rover.autopilot.mode in modes
        assert not [task for task in tasks.values() if task.state is S.EXECUTING]
        assert world.pose() == pytest.approx(where, abs=0.01), "it moved by itself"
