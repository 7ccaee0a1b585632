"""Tasks that run after those of another gateway's rover, in virtual time."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, FakeClient, Sent
from tests.kit.gateways.engines import LOOK, FleetWorld, Gateway
from tests.kit.gateways.order import early_starts
from tests.kit.mission import Item, Upload
from tests.kit.volume import some
from tests.kit.world import at

WITHIN = 1.0  # s for the answer of the database

MOVE, CANCEL, MODIFY, OPTIONS = 54000, 54010, 54012, 54014
RUN_AFTER = 4
A, B = 1, 2  # the rovers; a has the one, b the other


class Pair:
    """Gateways a and b with a rover each, which the other one does not hear."""

    def __init__(self, folder: Path, **kw: Any) -> None:
        self.world = FleetWorld(folder, rovers=2, **kw)
        self.a, self.b = self.world.gateways["server"], self.world.gateways["b"]
        for name in self.world.gateways:
            for rover in {"server": (B,), "b": (A,)}.get(name, (A, B)):
                self.world.cut(name, rover)
        near_b = self.world.add_client("client b", system_id=254, server="b:clients")
        self.clients = {"server": self.world.client, "b": near_b}
        assert (self.world.holder(A), self.world.holder(B)) == (self.a, self.b)
        self.world.run(4.0)

    def client(self, it: Gateway) -> FakeClient:
        return self.clients[it.name]

    def task(self, task_id: int) -> Task:
        """Return a task as it is stored."""
        return {int(task.id): task for task in self.world.shared.tasks()}[task_id]

    def send(
        self, rover: int, metres: float = 1.0, *, after: int = 0, by: Gateway | None = None
    ) -> Sent:
        it = by or (self.a if rover == A else self.b)
        return self.client(it).command(MOVE, metres, 0, 0, 0, after, 0, 5, target=(rover, 191))

    def submit(self, rover: int, metres: float = 1.0, *, after: int = 0) -> int:
        """Submit a move; return its id."""
        sent = self.send(rover, metres, after=after)
        self.world.run(0.3)
        assert sent.result == ACCEPTED
        return sent.task_id

    def cancel(self, rover: int, task_id: int) -> None:
        it = self.a if rover == A else self.b
        sent = self.client(it).command(CANCEL, task_id, target=(rover, 191))
        self.world.run(0.3)
        assert sent.result == ACCEPTED

    def until(self, task_id: int, state: S, *, within: float = 30) -> None:
        self.world.until(lambda: self.task(task_id).state is state, within=within)

    def state(self, task_id: int) -> tuple[S, R]:
        return self.task(task_id).state, self.task(task_id).reason

    def hears(self, it: Gateway, rover: int) -> None:
        """Drive a rover into the reach of one gateway and out of that of the other."""
        for each in (self.a, self.b):
            (self.world.mend if each is it else self.world.cut)(each.name, rover)

    def goes_to(self, it: Gateway, rover: int) -> None:
        self.hears(it, rover)
        self.world.until(lambda: self.world.holder(rover) is it, within=20)

    def drives(self, task_id: int) -> bool:
        return self.task(task_id).state in (S.STARTING, S.EXECUTING)


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[Pair]:
    it = Pair(tmp_path)
    yield it
    assert early_starts(it.world.shared.store.events) == []
    it.world.check()


def test_a_chain_over_both_runs_in_its_order(pair: Pair) -> None:
    tasks = [pair.submit(A, 2.0)]
    for rover in (B, A, B, A):
        tasks.append(pair.submit(rover, 0.5, after=tasks[-1]))
    pair.until(tasks[-1], S.COMPLETED, within=120)
    ended = [pair.task(each).changed_at for each in tasks]
    assert ended == sorted(ended)  # type: ignore[type-var]


def test_the_failure_of_the_first_fails_all_that_follow(pair: Pair) -> None:
    first = pair.submit(A, 5.0)
    second = pair.submit(B, after=first)
    third = pair.submit(A, after=second)
    pair.cancel(A, first)
    pair.until(third, S.FAILED, within=5)
    failed = (S.FAILED, R.DEPENDENCY_FAILED)
    assert (pair.state(second), pair.state(third)) == (failed, failed)


def test_without_an_answer_of_the_database_it_is_refused_in_time(pair: Pair) -> None:
    first = pair.submit(A, 3.0)
    pair.b.is_looking = False
    began = pair.world.now
    sent = pair.send(B, after=first)
    pair.world.until(lambda: sent.ack is not None, within=5)
    assert sent.answer is not None
    assert sent.answer[1] == R.STORE_UNAVAILABLE
    assert pair.world.now - began < WITHIN + 0.1
    pair.b.is_looking = True
    pair.submit(B, after=first)


def test_a_lost_notification_delays_the_task_only(tmp_path: Path) -> None:
    pair = Pair(tmp_path)
    pair.world.lost_notices = 1.0
    first = pair.submit(A)
    second = pair.submit(B, after=first)
    pair.until(first, S.COMPLETED)
    pair.world.until(lambda: pair.task(second).state is not S.BLOCKED, within=LOOK + 0.1)
    pair.world.check()


def test_a_halt_that_comes_before_the_answer_of_the_database_counts(pair: Pair) -> None:
    first = pair.submit(A, 3.0)
    near = pair.client(pair.b)
    pair.b.is_looking = False
    sent = pair.send(B, after=first)
    pair.world.run(0.1)
    near.stop(target=(B, 191))
    pair.world.run(0.1)
    pair.b.is_looking = True
    pair.b.notified()
    pair.world.run(0.5)
    assert sent.answer is not None
    assert sent.answer[1] == R.STALE


@for_each("n", some(range(8), 0, 2, 3, 5))
def test_an_end_in_the_moment_of_a_takeover_is_not_missed(tmp_path: Path, n: int) -> None:
    """The gateway of the waiting task dies around the end of the one that it waits for."""
    pair = Pair(tmp_path, names=("server", "b", "c"), seed=n)
    pair.world.mend("c", B)
    first = pair.submit(A, 2.0)
    second = pair.submit(B, 0.5, after=first)
    pair.until(first, S.EXECUTING)
    north = pair.world.rover.truth.north
    pair.world.until(lambda: pair.world.rover.truth.north - north > 1.9, within=20)
    pair.world.run(0.4 * n)
    pair.world.kill("b")
    pair.until(first, S.COMPLETED)
    pair.world.until(lambda: pair.task(second).state is not S.BLOCKED, within=3)
    assert early_starts(pair.world.shared.store.events) == []
    pair.world.check()


def test_a_circle_over_gateways_is_refused(pair: Pair) -> None:
    first = pair.client(pair.a).command(MOVE, 1.0, 0, 0, 0, 0, 60, 5, target=(A, 191))
    pair.world.run(0.3)
    second = pair.submit(B, after=first.task_id)
    third = pair.submit(A, after=second)
    changes = [
        pair.client(pair.a).command(MODIFY, first.task_id, RUN_AFTER, each, target=(A, 191))
        for each in (second, third)
    ]
    pair.world.run(0.3)
    assert [each.answer[1] for each in changes if each.answer] == [R.UNKNOWN_DEPENDENCY, R.CYCLE]
    assert pair.task(first.task_id).terms.after == 0


def test_a_mission_runs_after_a_task_of_another_gateway(pair: Pair) -> None:
    first = pair.submit(A, 2.0)
    items = [Item(OPTIONS, param1=5, param4=first), Item(16, **at(1.0, 0.0))]
    upload = Upload(pair.client(pair.b), items, target=(B, 191))
    pair.world.until(lambda: upload.result is not None, within=5)
    assert upload.result == 0
    (plan,) = (task for task in pair.world.shared.tasks() if task.vehicle == B)
    assert plan.state is S.BLOCKED
    pair.until(first, S.COMPLETED)
    pair.until(int(plan.id), S.EXECUTING, within=10)
