"""Gateways whose database is full, hangs, or can only be read, while a task runs."""

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from mav_tasks import Move, NoAnswer, Refused, TaskState
from tests.kit.gateways.serving import Serving, Watcher, serving, wait_for_holder, wrong_motions
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until

S = TaskState
#: s; the trust in a lease (0.7), and the busy machine's share
UNTIL_ZERO = 1.0
AT_ONCE = 0.3  # s for a STOP by way of another gateway, on a busy machine; it takes 0.05

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]


class Fleet:
    """Two gateways, and a task that runs."""

    def __init__(self, it: Serving, watcher: Watcher, metres: float) -> None:
        self.it, self.watcher = it, watcher
        self.holder = wait_for_holder(watcher)
        (self.other,) = set(it.processes) - {self.holder}
        with it.client(self.holder) as client:
            self.task = client.submit(Move(metres)).id
        self.until(S.EXECUTING)
        wait_until(lambda: self.motions_since(0.0) > 10, within=10, what="motions")

    def until(self, state: TaskState) -> None:
        wait_until(lambda: self.it.states()[self.task] is state, within=30, what=self.it.said)

    def motions_since(self, when: float) -> int:
        return sum(each.at > when for each in self.it.motions)

    def zero_after(self, when: float) -> float:
        """Return after how many seconds the first set-point came that stops the rover."""

        def found() -> float:
            return next((each.at - when for each in self.it.zeros if each.at > when), 0.0)

        return wait_until(found, within=10, what="a zero set-point")

    def said(self, words: str) -> None:
        self.it.processes[self.holder].wait_for(words)


@contextmanager
def driving(server: PostgresServer, folder: Path, metres: float) -> Iterator[Fleet]:
    with serving(server, folder, "ab") as it, closing(Watcher(it.url)) as watcher:
        yield Fleet(it, watcher, metres)
        assert wrong_motions(it.motions, watcher.seen) == []


@contextmanager
def full(fleet: Fleet) -> Iterator[None]:
    """Let tasks and events find no room on the database's disk, for a block."""
    server, database = fleet.it.server, fleet.it.url.rpartition("/")[2]
    server.execute(
        "CREATE FUNCTION mav_tasks.full() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN"
        " RAISE 'could not extend file: No space left on device' USING ERRCODE = '53100';"
        " END $$",
        database=database,
    )
    for table in ("journal", "tasks"):
        server.execute(
            f"CREATE TRIGGER full_{table} BEFORE INSERT OR UPDATE ON mav_tasks.{table}"
            " FOR EACH ROW EXECUTE FUNCTION mav_tasks.full()",
            database=database,
        )
    yield
    server.execute("DROP FUNCTION mav_tasks.full() CASCADE", database=database)


def test_with_a_full_disk_the_task_goes_on_and_a_stop_at_the_other_gateway_works(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    with driving(postgres, tmp_path, 20.0) as fleet, fleet.it.client(fleet.other) as client:
        with full(fleet):
            fleet.said("the disk of the database is full .*: new tasks are refused")
            began = time.monotonic()
            wait_until(lambda: fleet.motions_since(began) > 10, within=5, what="it drives on")
            with pytest.raises(Refused):
                client.submit(Move(1.0))
            asked = time.monotonic()
            with pytest.raises(Refused, match="STOP is in force, but not stored"):
                client.stop()
            assert fleet.zero_after(asked) < AT_ONCE
            assert fleet.motions_since(asked + AT_ONCE) == 0
        fleet.until(S.KILLED)


def test_a_stop_at_the_other_gateway_while_the_database_hangs_holds_when_it_goes_on(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    with driving(postgres, tmp_path, 20.0) as fleet, fleet.it.client(fleet.other) as client:
        with postgres.frozen():
            began = time.monotonic()
            with pytest.raises(NoAnswer):
                client.stop()
            assert fleet.zero_after(began) < UNTIL_ZERO
            later = began + 4.0  # longer than a STOP would be of use to a gateway that is reached
            wait_until(lambda: time.monotonic() > later, within=6)
            assert fleet.motions_since(began + UNTIL_ZERO) == 0
        fleet.until(S.KILLED)
        assert fleet.motions_since(began + UNTIL_ZERO) == 0
