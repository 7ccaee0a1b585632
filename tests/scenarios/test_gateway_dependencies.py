"""Tasks that run after those of another gateway's rover, in virtual time."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from mav_tasks.config.settings import Limits, Roles, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Task
from tests.kit.client import ACCEPTED, Sent, heartbeat, packed
from tests.kit.gateways.engines import FleetWorld
from tests.kit.gateways.order import early_starts
from tests.kit.mission import Item, Upload
from tests.kit.rows import check
from tests.kit.world import at

WITHIN = 1.0  # s for the answer of the database

MOVE, MODIFY = 54000, 54012
RUN_AFTER = 4
A, B = 1, 2  # the rovers; a has the one, b the other
SLOW = Settings(
    roles=Roles(addresses={"200/190": "submitter"}, submitter=Limits(max_speed=0.1)),
)


class Pair(FleetWorld):
    """Gateways a and b with a rover each, which the other one does not hear."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, rovers=2, settings=SLOW)
        self.a, self.b = self.gateways["server"], self.gateways["b"]
        self.cut("server", B)
        self.cut("b", A)
        near_b = self.add_client("client b", system_id=254, server="b:clients")
        self.clients = {"server": self.client, "b": near_b}
        assert (self.holder(A), self.holder(B)) == (self.a, self.b)
        self.run(4.0)

    def task(self, task_id: int) -> Task:
        """Return a task as it is stored."""
        return {int(task.id): task for task in self.shared.tasks()}[task_id]

    def send(self, rover: int, metres: float = 1.0, *, after: int = 0) -> Sent:
        """Submit a move at the gateway that has the rover."""
        near = self.clients["server" if rover == A else "b"]
        return near.command(MOVE, metres, 0, 0, 0, after, 0, 5, target=(rover, 191))

    def submit(self, rover: int, metres: float = 1.0, *, after: int = 0) -> int:
        """Submit a move; return its id."""
        sent = self.send(rover, metres, after=after)
        self.run(0.3)
        assert sent.result == ACCEPTED
        return sent.task_id


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[Pair]:
    it = Pair(tmp_path)
    yield it
    assert early_starts(it.shared.store.events) == []
    it.check()


def test_without_an_answer_of_the_database_it_is_refused_in_time(pair: Pair) -> None:
    first = pair.submit(A, 3.0)
    pair.b.is_looking = False
    began = pair.now
    sent = pair.send(B, after=first)
    pair.until(lambda: sent.ack is not None, within=5)
    assert sent.answer is not None
    assert sent.answer[1] == R.STORE_UNAVAILABLE
    assert pair.now - began < WITHIN + 0.1
    pair.b.is_looking = True
    pair.submit(B, after=first)


def test_a_task_for_any_rover_and_a_plan_wait_for_the_answer(pair: Pair) -> None:
    first, second = pair.submit(A, 3.0), pair.submit(A)
    near = pair.clients["b"]
    pair.b.is_looking = False
    sent = near.command(MOVE, 1.0, 0, 0, 0, first, target=(250, 191))
    items = [Item(16, **at(1, 3)), Item(54014, param4=second, frame=2)]
    plan = Upload(near, items, target=(B, 191))
    pair.run(0.2)
    assert (sent.result, plan.result) == (None, None)
    pair.b.is_looking = True
    pair.b.notified()
    pair.run(0.5)
    assert (sent.result, plan.result) == (ACCEPTED, 0)


def test_a_plan_that_waits_has_the_rights_of_its_client(pair: Pair) -> None:
    first = pair.submit(A)
    slow = pair.add_client("slow", system_id=200, server="b:clients")
    pair.b.is_looking = False
    items = [Item(16, **at(1, 3)), Item(54014, param4=first, frame=2)]
    plan = Upload(slow, items, target=(B, 191))
    pair.run(0.2)
    slow.send_raw(packed(heartbeat(), 254, 190, seq=7))  # an operator's, from the same endpoint
    pair.run(0.1)
    pair.b.is_looking = True
    pair.b.notified()
    pair.run(0.5)
    task = pair.task(plan.opaque_id)
    assert (task.terms.top_speed, task.submitter.system_id) == (0.1, 200)


def test_a_halt_that_comes_before_the_answer_of_the_database_counts(pair: Pair) -> None:
    first = pair.submit(A, 3.0)
    near = pair.clients["b"]
    pair.b.is_looking = False
    sent = pair.send(B, after=first)
    pair.run(0.1)
    near.stop(target=(B, 191))
    pair.run(0.1)
    pair.b.is_looking = True
    pair.b.notified()
    pair.run(0.5)
    assert sent.answer is not None
    assert sent.answer[1] == R.STALE


def test_a_circle_over_gateways_is_refused(pair: Pair) -> None:
    first = pair.client.command(MOVE, 1.0, 0, 0, 0, 0, 60, 5, target=(A, 191))
    pair.run(0.3)
    second = pair.submit(B, after=first.task_id)
    third = pair.submit(A, after=second)
    changes = [
        pair.client.command(MODIFY, first.task_id, RUN_AFTER, each, target=(A, 191))
        for each in (second, third)
    ]
    pair.run(0.3)
    assert [each.answer[1] for each in changes if each.answer] == [R.UNKNOWN_DEPENDENCY, R.CYCLE]
    assert pair.task(first.task_id).terms.after == 0


def test_a_task_starts_or_fails_with_the_one_at_another_gateway_that_it_runs_after(
    pair: Pair,
) -> None:
    first, second = pair.submit(A, 0.5), pair.submit(A, 0.6)
    waiting = [pair.submit(B, 0.5, after=each) for each in (first, second)]
    check(
        pair,
        f"""
REQUEST_MESSAGE 54000 {waiting[0]} to=second : ACCEPTED
wait 2 & TASK_CANCEL {second} & wait 9 : ACCEPTED
b> TASK_MOVE 1 0 0 0 {second} to=second : DENIED that task has ended (cancelled)
""",
        b=pair.clients["b"],
    )
    assert [pair.task(each).state for each in waiting] == [S.COMPLETED, S.FAILED]


def test_a_gateway_forgets_one_of_its_rovers_and_no_other(pair: Pair) -> None:
    near = pair.clients["b"]
    for here, there, rows in (
        (
            "b",
            "server",
            """
b> TASK_MOVE 0.3 & wait 5 : ACCEPTED done
b> NAV_WAYPOINT at=1,0 frame=0 & TASK_MOVE 3 : ACCEPTED+ACCEPTED
b> TASK_MOVE 1 to=second & NAV_WAYPOINT at=3,0 to=second frame=0 : ACCEPTED+ACCEPTED
""",
        ),
        ("server", "b", "b> TASK_MOVE 3 : ACCEPTED"),
    ):
        pair.mend(here, A)
        pair.cut(there, A)
        pair.run(20.0)
        assert pair.database.holder(A) == here
        check(pair, rows, b=near)
