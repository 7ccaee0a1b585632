"""A series in real processes: killed between two runs and at the end of one; its commands."""

import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from mav_tasks import Refused, SyncClient
from tests.kit.commands import Done, called, mav_tasks
from tests.kit.processes import Stand

WAY = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t0\t0\t0\t1
1\t0\t2\t54000\t0.1\t0.5\t0\t0\t0\t0\t0\t1
"""


# commands


@pytest.fixture
def server(there: Stand) -> Iterator[str]:
    url = f"udpout:127.0.0.1:{there.client_port}"
    yield url
    with SyncClient(url, component_id=99) as client, suppress(Refused):
        client.clear(running_too=True)


def test_a_series_is_submitted_looked_at_and_ended(server: str) -> None:
    options = ("--every", "1h30m", "--in", "10m", "--deadline", "5m", "--json")
    (task,) = called("submit", "move", "0.2", *options, server=server).objects
    assert (task["every"], task["cron"], task["series"]) == (5400, None, task["id"])
    assert 590 < task["time_to_start"] <= 600
    number = str(task["id"])
    shown = called("status", number, server=server).lines
    assert "repeats       every 1h30m" in shown
    assert f"series        {number}" in shown
    assert "every 1h30m" in called("queue", server=server).output

    told = f"it repeats; to end its series: mav-tasks cancel --series {number}"
    cancelled = called("cancel", number, server=server).lines
    assert cancelled == [f"rover 1: task {number} cancelled; {told}"]
    (queue,) = called("queue", "--json", server=server).objects
    (following,) = queue["waiting"]
    assert (following["series"], following["every"]) == (task["id"], 5400)
    assert following["time_to_start"] == pytest.approx(5400 + 600, abs=30)

    ended = called("cancel", number, "--series", server=server)
    assert ended.lines == [f"rover 1: task {following['id']} cancelled, and its series"]
    (queue,) = called("queue", "--json", server=server).objects
    assert queue["waiting_count"] == 0
    again = called("cancel", number, "--series", server=server)
    assert (again.status, "does not repeat" in again.error) == (1, True)


def test_the_commands_of_the_guide_do_what_it_says(server: str, tmp_path: Path) -> None:
    (tmp_path / "round.waypoints").write_text(WAY, encoding="ascii")

    def run(line: str, task: str = "") -> Done:
        words = shlex.split(line.replace("12", task) if task else line)
        done = mav_tasks(*words, server=server, folder=tmp_path)
        assert (done.status, done.error) == (0, ""), line
        return done

    run("submit wait 1h")  # so that the patrol does not end before it is cancelled
    patrol, mission = (
        run(line).output.strip().rpartition(" ")[2]
        for line in (
            "submit move 5 --label patrol --every 1h --deadline 10m",
            'mission upload round.waypoints --every "0 6 * * 1-5 Europe/Zurich"',
        )
    )
    assert run("modify 12 --every never", mission).lines == [f"rover 1: task {mission} changed"]
    ended = run("cancel --series 12", patrol)
    assert ended.lines == [f"rover 1: task {patrol} cancelled, and its series"]
    run("cancel")
