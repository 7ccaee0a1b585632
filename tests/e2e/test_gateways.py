"""Two gateways over one fleet: real servers, a real PostgreSQL, a real rover process."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from mav_tasks import Move, Refused, SyncClient, TaskReason, TaskState
from tests.kit.commands import mav_tasks
from tests.kit.postgres import PostgresServer, connected
from tests.kit.processes import Process, free_udp_ports, process, wait_until

S = TaskState
pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]


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

    def add_rover(self, system_id: int) -> int:
        """Start another rover; return its port."""
        (port,) = free_udp_ports(1)
        rover = ["--port", str(port), "--body", "kinematic", "--boot", "none"]
        rover += ["--system-id", str(system_id)]
        it = process("-m", "rover_sim", *rover, folder=self._folder, name=f"r{system_id}")
        self._opened.enter_context(it)
        return port

    def start(self, name: str, *options: str, rover: int = 0) -> Process:
        """Start a gateway that hears a rover at a port, by default the first one."""
        port = self.ports.setdefault(name, self._client_ports[len(self.ports) % 3])
        command = ["-m", "mav_tasks.cli", "serve", "--gateway", name, "--store", self.url]
        command += ["--client", f"udpin:127.0.0.1:{port}", "--no-push"]
        command += ["--vehicle", f"udpout:127.0.0.1:{rover or self.rover_port}"]
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
            within=30,
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


@pytest.mark.parametrize("asked", ["a", "b"])
def test_a_pause_outlives_its_gateway_which_is_killed_just_after_it(
    fleet: Fleet, asked: str
) -> None:
    fleet.start("a")
    assert fleet.holder() == "a"
    fleet.start("b")
    fleet.client("a").submit(Move(5.0), delay=4.0)
    client = fleet.client(asked)
    client.pause()
    fleet.processes["a"].end(signal.SIGKILL)
    fleet.processes["b"].wait_for("rover 1: found")
    until = (
        latest(fleet.truth)["time"] + 8.0
    )  # the task's time comes, and the gateway listens first
    wait_until(lambda: latest(fleet.truth)["time"] > until, within=30, what="time to drive")
    assert latest(fleet.truth)["north"] == 0.0
    assert fleet.client("b").queue().paused is TaskReason.OPERATOR


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


def test_a_gateway_that_ends_leaves_its_rover_to_another_at_once(
    fleet: Fleet, tmp_path: Path
) -> None:
    fleet.start("a", "--record", str(tmp_path / "records"))
    assert fleet.holder() == "a"
    fleet.start("b")
    waits = fleet.client("a").submit(Move(0.5), delay=3600.0)
    fleet.processes["a"].popen.send_signal(signal.SIGINT)
    fleet.processes["b"].wait_for("rover 1: found")
    b = fleet.client("b")
    assert b.status(waits.id).state is S.SCHEDULED
    done = b.submit(Move(0.5)).done()
    assert done.state is S.COMPLETED
    (record,) = (tmp_path / "records").iterdir()
    assert "same: " in mav_tasks("replay", str(record)).output


def test_without_the_database_the_rover_stops_and_the_task_goes_on_with_it(
    postgres: PostgresServer, fleet: Fleet
) -> None:
    fleet.start("a")
    assert fleet.holder() == "a"
    task = fleet.client("a").submit(Move(5.0))
    fleet.until_state(task.id, S.EXECUTING)
    with postgres.frozen():
        fleet.processes["a"].wait_for("cannot renew its lease: its rovers are stopped")
        wait_until(lambda: speed(fleet.truth) < 0.01, within=5)
        client = fleet.client("a")
        with pytest.raises(Refused, match="STOP is in force, but not stored"):
            client.stop()  # is obeyed without the database
    fleet.processes["a"].wait_for("has renewed its lease")
    fleet.until_state(task.id, S.KILLED)


def test_a_client_at_another_gateway_drives_and_stops_the_rover(fleet: Fleet) -> None:
    fleet.start("a")
    assert fleet.holder() == "a"
    fleet.start("b")
    b = fleet.client("b")
    assert [rover.id for rover in b.vehicles()] == [1]
    done = b.submit(Move(0.5), nonce=5).done()
    assert done.state is S.COMPLETED
    assert fleet.client("a").submit(Move(0.5), nonce=5).id == done.id
    task = b.submit(Move(8.0))
    fleet.until_state(task.id, S.EXECUTING)
    b.stop()
    fleet.until_state(task.id, S.KILLED)
    wait_until(lambda: speed(fleet.truth) < 0.01, within=5)
    fleet.processes["a"].end(signal.SIGKILL)
    fleet.processes["b"].wait_for("rover 1: found")
    queue = b.queue()
    assert queue.paused is TaskReason.STOPPED


def test_a_stop_of_all_is_acknowledged_by_each_gateway_for_its_rover(fleet: Fleet) -> None:
    second = fleet.add_rover(2)
    fleet.start("a")
    fleet.start("b", rover=second)
    fleet.processes["a"].wait_for("rover 1: found")
    fleet.processes["b"].wait_for("rover 2: found")
    b = fleet.client("b")
    wait_until(lambda: [rover.id for rover in b.vehicles()] == [1, 2], within=10)
    tasks = [b.submit(Move(8.0), vehicle=rover) for rover in (1, 2)]
    for task in tasks:
        fleet.until_state(task.id, S.EXECUTING)
    b.stop()
    assert [b.queue(vehicle=rover).paused for rover in (1, 2)] == [TaskReason.STOPPED] * 2
    for task in tasks:
        fleet.until_state(task.id, S.KILLED)


def speed(truth: Path) -> float:
    """Return the rover's latest true speed, m/s."""
    return abs(latest(truth)["forward_speed"])


def latest(truth: Path) -> dict[str, float]:
    """Return the rover's latest true state."""
    header, *_, last, _ = truth.read_text(encoding="ascii").split("\n")
    return dict(zip(header.split(","), map(float, last.split(",")), strict=True))
