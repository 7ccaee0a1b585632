"""The fleet's database fails over to its replica while a rover drives: two real servers.

The primary acknowledges no commit that the replica does not have. The URL names both.
"""

from contextlib import ExitStack, closing, suppress
from math import hypot
from pathlib import Path

import pytest

from mav_tasks import Move, Refused, SyncClient, SyncTask, TaskState
from rover_sim.postgres import installed
from tests.e2e.test_gateways import Fleet, release, speed
from tests.kit.postgres import PostgresServer, Standby
from tests.kit.processes import wait_until

S = TaskState
pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]


def test_the_rover_stops_and_all_goes_on_with_the_replica(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    with ExitStack() as opened:
        primary = opened.enter_context(closing(PostgresServer(installed())))
        primary.start()
        name = primary.new_database().rpartition("/")[2]
        replica = opened.enter_context(closing(Standby(primary)))
        ports = primary.port, replica.port
        url = "postgresql://postgres@{}/{}".format(
            ",".join(f"127.0.0.1:{port}" for port in ports), name
        )
        fleet = Fleet(opened, tmp_path, url)
        fleet.start("a")
        assert fleet.holder() == "a"
        fleet.start("b")
        a, b = fleet.client("a"), fleet.client("b")
        first = a.submit(Move(0.5)).done()
        ran, waits = a.submit(Move(6.0)), b.submit(Move(0.5))
        fleet.until_state(ran.id, S.EXECUTING)
        wait_until(lambda: speed(fleet.truth) > 0.3, within=10)

        primary.kill()
        fleet.processes["a"].wait_for("cannot renew its lease: its rovers are stopped")
        wait_until(lambda: speed(fleet.truth) < 0.01, within=5)
        replica.promote()
        holder = fleet.holder()
        client = fleet.client(holder)
        new = wait_until(lambda: submitted(client), within=20, what="a store that works")
        if fleet.state(ran.id) is S.HELD:
            release(client, ran.id)
        fleet.until_state(new.id, S.COMPLETED)
        assert new.id > waits.id > ran.id > first.id
        assert {fleet.state(each) for each in (first.id, ran.id, waits.id)} == {S.COMPLETED}
        assert distance(fleet.truth) == pytest.approx(7.25, abs=0.15)


def submitted(client: SyncClient) -> SyncTask | None:
    """Submit a task, if the store works."""
    with suppress(Refused):
        return client.submit(Move(0.25))
    return None


def distance(truth: Path) -> float:
    """Return how far from its begin the rover is, m."""
    header, *rows, _ = truth.read_text(encoding="ascii").split("\n")
    names = header.split(",")
    ends = [
        dict(zip(names, map(float, row.split(",")), strict=True)) for row in (rows[0], rows[-1])
    ]
    return hypot(*(ends[1][axis] - ends[0][axis] for axis in ("north", "east")))
