"""A series in a fleet: it moves with its rover, and any gateway lets a task repeat."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from mav_tasks.tasks.lifecycle import TERMINAL, WAITING
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.client import ACCEPTED
from tests.scenarios.test_gateways import Fleet

CANCEL, MODIFY, EVERY = 54010, 54012, 9


@pytest.fixture
def fleet(tmp_path: Path) -> Iterator[Fleet]:
    it = Fleet(tmp_path)
    yield it
    it.world.check()


def runs(fleet: Fleet, series: int) -> list[Task]:
    """Return the runs of a series as they are stored; each gateway has ids of its own."""
    stored = [task for task in fleet.world.shared.tasks() if task.terms.series == series]
    return sorted(stored, key=lambda task: task.submitted_at)


def every(fleet: Fleet, seconds: int, metres: float = 0.2) -> int:
    task = fleet.submit(metres)
    sent = fleet.client.command(MODIFY, task, EVERY, seconds)
    fleet.world.run(0.2)
    assert sent.answer == (ACCEPTED, task)
    return task


@pytest.mark.parametrize("how", ["between two runs", "again and again"])
def test_a_takeover_makes_neither_two_runs_nor_none(fleet: Fleet, how: str) -> None:
    task = every(fleet, 20)
    fleet.world.until(lambda: fleet.task(task).state is S.COMPLETED, within=15)
    fleet.world.run(0.5)
    start = fleet.task(task).terms.start_at
    (planned,) = [each for each in runs(fleet, task) if each.state in WAITING]
    fleet.world.kill(fleet.first.name)
    assert fleet.world.holder() is fleet.other
    fleet.world.until(lambda: fleet.task(planned.id).state is S.COMPLETED, within=40)
    fleet.world.run(0.5)
    found = runs(fleet, task)
    assert [each.state for each in found] == [S.COMPLETED, S.COMPLETED, S.SCHEDULED]
    assert start is not None
    assert [each.terms.start_at for each in found] == pytest.approx(
        [start, start + 20, start + 40], abs=1e-3
    )
    if how == "again and again":
        fleet.world.run(90)
        found = runs(fleet, task)
        assert [each.state in TERMINAL for each in found] == [*[True] * (len(found) - 1), False]
        assert len(found) >= 6
        assert {each.submitter for each in found} == {found[0].submitter}


def test_a_client_at_another_gateway_lets_a_task_repeat_and_ends_that(fleet: Fleet) -> None:
    fleet.world.run(3.0)
    far = fleet.clients[fleet.other.name]
    sent = far.move(0.2, nonce=77)
    fleet.world.until(lambda: sent.ack is not None, within=2)
    asked = far.command(MODIFY, sent.task_id, EVERY, 20)
    fleet.world.until(lambda: asked.ack is not None, within=2)
    assert asked.answer == (ACCEPTED, sent.task_id)
    fleet.world.until(lambda: len(runs(fleet, sent.task_id)) == 2, within=15)
    ended = far.command(CANCEL, sent.task_id, 0, 1)
    fleet.world.until(lambda: ended.ack is not None, within=2)
    assert ended.result == ACCEPTED
    fleet.world.run(30)
    assert [each.state for each in runs(fleet, sent.task_id)] == [S.COMPLETED, S.CANCELLED]
