"""A task that runs after one of another gateway's rover: real servers, a real PostgreSQL."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from mav_tasks import Move, Refused, TaskReason, TaskState
from tests.e2e.test_gateways import Fleet
from tests.kit.commands import mav_tasks
from tests.kit.postgres import PostgresServer
from tests.kit.processes import wait_until

S = TaskState
pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]


@pytest.fixture
def fleet(postgres: PostgresServer, tmp_path: Path) -> Iterator[Fleet]:
    with ExitStack() as opened:
        yield Fleet(opened, tmp_path, postgres.new_database())


def test_tasks_run_after_those_of_another_gateway(fleet: Fleet, tmp_path: Path) -> None:
    second = fleet.add_rover(2)
    fleet.start("a", "--record", str(tmp_path / "records"))
    fleet.start("b", rover=second)
    fleet.processes["a"].wait_for("rover 1: found")
    fleet.processes["b"].wait_for("rover 2: found")
    a = fleet.client("a")
    wait_until(lambda: [rover.id for rover in a.vehicles()] == [1, 2], within=10)
    a.pause(vehicle=1)
    ahead = a.submit(Move(0.5), vehicle=1)
    behind = a.submit(Move(0.25), vehicle=2, after=ahead.id)
    last = a.submit(Move(0.25), vehicle=1, after=behind.id)
    with pytest.raises(Refused, match="run after 77777: no such task") as refused:
        a.submit(Move(0.25), vehicle=2, after=77777)
    assert refused.value.reason == TaskReason.UNKNOWN_DEPENDENCY
    assert (fleet.state(behind.id), fleet.state(last.id)) == (S.BLOCKED, S.BLOCKED)

    fleet.processes["b"].end(signal.SIGKILL)
    fleet.start("b", rover=second)  # it finds the dependency in the database
    fleet.processes["b"].wait_for("rover 2: found")
    assert (fleet.state(ahead.id), fleet.state(behind.id)) == (S.QUEUED, S.BLOCKED)
    a.resume(vehicle=1)
    fleet.until_state(last.id, S.COMPLETED)
    assert (fleet.state(ahead.id), fleet.state(behind.id)) == (S.COMPLETED, S.COMPLETED)

    ahead = a.submit(Move(8.0), vehicle=1)
    behind = a.submit(Move(0.25), vehicle=2, after=ahead.id)
    ahead.cancel()
    fleet.until_state(behind.id, S.FAILED)

    fleet.processes["a"].popen.send_signal(signal.SIGINT)
    fleet.processes["a"].popen.wait(timeout=10)
    (record,) = (tmp_path / "records").iterdir()
    assert "same: " in mav_tasks("replay", str(record)).output
