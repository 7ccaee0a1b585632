"""Two gateways over one fleet: real servers, a real PostgreSQL, a real rover process."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from mav_tasks import Move, NoAnswer, Refused, SyncClient, TaskState
from tests.kit.commands import mav_tasks
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import Process, free_udp_ports, process, wait_until

S = TaskState
pytestmark = [pytest.mark.slow, pytest.mark.timeout(200)]


class Fleet:
    """A rover, a database and gateways."""

    def __init__(self, opened: ExitStack, folder: Path, url: str) -> None:
        self._opened, self._folder, self.url = opened, folder, url
        self.rover_port, *self._client_ports = free_udp_ports(4)
        self.processes: dict[str, Process] = {}
        self.ports: dict[str, int] = {}
        self.truth = folder / "truth.csv"
        rover = ["--port", str(self.rover_port), "--body", "kinematic", "--boot", "none"]
        opened.enter_context(
            process("-m", "rover_sim", *rover, "--truth", str(self.truth), folder=folder, name="r")
        )

    def start(self, name: str, *options: str) -> Process:
        """Start a gateway that hears the rover."""
        port = self.ports.setdefault(name, self._client_ports[len(self.ports) % 3])
        command = ["-m", "mav_tasks.cli", "serve", "--gateway", name, "--store", self.url]
        command += ["--client", f"udpin:127.0.0.1:{port}", "--no-push"]
        command += ["--vehicle", f"udpout:127.0.0.1:{self.rover_port}"]
        command += ["--set", "rules.loss_failsafe=accept", *options]
        label = f"{name}{sum(each.startswith(name) for each in self.processes)}"
        it = process(*command, folder=self._folder, name=label)
        self.processes[name] = self._opened.enter_context(it)
        self.processes[name].wait_for(f"as gateway {name} of its fleet")
        return self.processes[name]

    def client(self, name: str) -> SyncClient:
        """Return a client of a gateway."""
        return self._opened.enter_context(SyncClient(f"udpout:127.0.0.1:{self.ports[name]}"))

    def holder(self) -> str:
        """Return who has the rover, once somebody has it."""
        query = (
            "SELECT name FROM holdings JOIN gateways ON gateway = gateways.number WHERE vehicle = 1"
        )

        def found() -> Any:
            with connected(self.url) as connection:
                return connection.execute(query).fetchall()

        return str(wait_until(found, within=20, what="a holder")[0][0])

    def state(self, task_id: int) -> TaskState:
        """Return a task's state as it is stored."""
        with connected(self.url) as connection:
            query = "SELECT state FROM tasks WHERE id = %s"
            return TaskState(connection.execute(query, (task_id,)).fetchone()[0])

    def until_state(self, task_id: int, state: TaskState) -> None:
        wait_until(
            lambda: self.state(task_id) is state,
            within=60,
            what=lambda: f"{state.name}: it is {self.state(task_id).name}",
        )


@pytest.fixture
def fleet(postgres: PostgresServer, tmp_path: Path) -> Iterator[Fleet]:
    with ExitStack() as opened:
        yield Fleet(opened, tmp_path, postgres.new_database())


def test_a_gateway_takes_over_from_one_that_was_killed(fleet: Fleet) -> None:
    fleet.start("a")
    assert fleet.holder() == "a"
    fleet.start("b")
    a, b = fleet.client("a"), fleet.client("b")
    ran, waits = a.submit(Move(8.0)), a.submit(Move(0.5))
    fleet.until_state(ran.id, S.EXECUTING)
    assert (a.queue().gateway, b.queue().gateway) == ("a", "a")
    queue = mav_tasks("queue", server=f"udpout:127.0.0.1:{fleet.ports['b']}")
    assert queue.lines[0].startswith("rover 1 (gateway a): task")
    fleet.processes["a"].end(signal.SIGKILL)
    fleet.processes["b"].wait_for("rover 1: found")
    fleet.processes["b"].wait_for(f"task {ran.id} held: interrupted")
    assert fleet.holder() == "b"
    assert b.status(waits.id).state is S.QUEUED
    assert b.queue().gateway == "b"
    new = b.submit(Move(0.25))
    assert new.id not in (ran.id, waits.id)
    release(b, ran.id)
    fleet.until_state(new.id, S.COMPLETED)
    assert (fleet.state(ran.id), fleet.state(waits.id)) == (S.COMPLETED, S.COMPLETED)


def release(client: SyncClient, task_id: int) -> None:
    """Release a held task; words from before do not count just after a takeover."""

    def is_released() -> bool:
        with suppress(Refused):
            client.task(task_id).release("remainder")
            return True
        return False

    wait_until(is_released, within=15, what="a release")


def test_a_gateway_that_stood_still_begins_again_without_the_rover(fleet: Fleet) -> None:
    fleet.start("a")
    assert fleet.holder() == "a"
    fleet.start("b")
    task = fleet.client("a").submit(Move(8.0))
    fleet.until_state(task.id, S.EXECUTING)
    fleet.processes["a"].popen.send_signal(signal.SIGSTOP)
    fleet.processes["b"].wait_for(f"task {task.id} held: interrupted")
    fleet.processes["a"].popen.send_signal(signal.SIGCONT)
    fleet.processes["a"].wait_for("gateway a begins again, without rovers")
    wait_until(lambda: fleet.processes["a"].text.count("as gateway a of its fleet") == 2, within=20)
    assert fleet.holder() == "b"
    assert fleet.client("b").status(task.id).state is S.HELD


def test_a_stop_at_another_gateway_counts_while_the_database_hangs_and_one_that_ends_hands_over(
    postgres: PostgresServer, fleet: Fleet, tmp_path: Path
) -> None:
    fleet.start("a", "--record", str(tmp_path / "records"))
    assert fleet.holder() == "a"
    fleet.start("b")
    task = fleet.client("a").submit(Move(5.0))
    fleet.until_state(task.id, S.EXECUTING)
    b = fleet.client("b")
    with postgres.frozen():
        with pytest.raises(NoAnswer):
            b.stop()  # is obeyed without the database
        wait_until(lambda: speed(fleet.truth) < 0.01, within=5)
        fleet.processes["a"].wait_for("cannot renew its lease: its rovers are stopped")
    fleet.until_state(task.id, S.KILLED)
    fleet.processes["a"].popen.send_signal(signal.SIGINT)
    fleet.processes["b"].wait_for("rover 1: found")
    assert fleet.holder() == "b"
    (record,) = (tmp_path / "records").iterdir()
    assert "same: " in mav_tasks("replay", str(record)).output


def speed(truth: Path) -> float:
    """Return the rover's latest true speed, m/s."""
    return abs(latest(truth)["forward_speed"])


def latest(truth: Path) -> dict[str, float]:
    """Return the rover's latest true state."""
    header, *_, last, _ = truth.read_text(encoding="ascii").split("\n")
    return dict(zip(header.split(","), map(float, last.split(",")), strict=True))
