"""A series in real processes: killed between two runs and at the end of one; its commands."""

import shlex
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from mav_tasks import Move, Refused, SyncClient, TaskStatus
from tests.kit.commands import Done, called, mav_tasks
from tests.kit.processes import Stand, free_udp_ports, process, stand, wait_until

PERIOD = 10  # s, the shortest
WAY = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t0\t0\t0\t1
1\t0\t2\t54000\t0.1\t0.5\t0\t0\t0\t0\t0\t1
"""


class Rover:
    """A simulated rover, and one server after another on the same ports and the same store."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.client_port, self.rover_port = free_udp_ports(2)

    @contextmanager
    def rover(self) -> Iterator[None]:
        port = str(self.rover_port)
        sim = ("-m", "rover_sim", "--port", port, "--body", "kinematic", "--boot", "none")
        with process(*sim, folder=self.folder, name="rover"):
            yield

    @contextmanager
    def server(self, name: str, *module: str) -> Iterator[SyncClient]:
        """Run a server; the block must end it, or its end kills it."""
        serve = ["-m", *(module or ("mav_tasks.cli",)), "serve", "--no-push"]
        serve += ["--client", f"udpin:127.0.0.1:{self.client_port}"]
        serve += ["--vehicle", f"udpout:127.0.0.1:{self.rover_port}"]
        serve += ["--store", str(self.folder / "tasks.sqlite3")]
        serve += ["--set", "rules.on_restart=continue"]
        with process(*serve, folder=self.folder, name=name) as server:
            server.wait_for("rover 1: found")
            with SyncClient(f"udpout:127.0.0.1:{self.client_port}") as client:
                yield client
                if server.popen.poll() is None and not module:
                    server.end(signal.SIGKILL)
                wait_until(lambda: server.popen.poll() is not None, within=20, what="its end")


def runs_of(client: SyncClient, series: int) -> list[TaskStatus]:
    """Return all runs of a series, in the order of their ids."""
    queue = client.queue()
    current = [] if queue.current is None else [queue.current]
    found = [*client.history(limit=50), *current, *queue.waiting]
    return sorted((each for each in found if each.series == series), key=lambda each: each.id)


def states(runs: list[TaskStatus]) -> list[str]:
    return [each.state.name for each in runs]


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_server_killed_between_two_runs_drives_each_once(tmp_path: Path) -> None:
    it = Rover(tmp_path)
    with it.rover():
        with it.server("first") as client:
            task = client.submit(Move(0.2), every=PERIOD, deadline=PERIOD)
            task.done(timeout=20)
            wait_until(lambda: len(runs_of(client, task.id)) == 2, within=5, what="the next run")
        with it.server("second") as client:
            wait_until(
                lambda: states(runs_of(client, task.id))[:2] == ["COMPLETED", "COMPLETED"],
                within=3 * PERIOD,
                what="the run that was planned before the crash",
            )
            runs = wait_until(
                lambda: runs if len(runs := runs_of(client, task.id)) > 2 else None,
                within=5,
                what="the run after it",
            )
            assert states(runs) == ["COMPLETED", "COMPLETED", "SCHEDULED"]


# commands


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    with stand(tmp_path_factory.mktemp("stand")) as running:
        yield running


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
