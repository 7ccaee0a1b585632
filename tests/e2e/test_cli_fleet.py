"""The command line with two rovers: which of them is meant, and which need not be named."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.commands import called
from tests.kit.processes import free_udp_ports, process


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder: Path = tmp_path_factory.mktemp("fleet")
    client, rover = free_udp_ports(2)
    exact = ("--noise", "off")
    sim = ("-m", "rover_sim", "--port", str(rover), "--body", "kinematic", "--count", "2", *exact)
    serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{client}", "--no-push"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{rover}", "--store", ":memory:"]
    with (
        process(*sim, folder=folder, name="rovers"),
        process(*serve, folder=folder, name="server") as running,
    ):
        running.wait_for("vehicle 1: found")
        running.wait_for("vehicle 2: found")
        yield f"udpout:127.0.0.1:{client}"


def test_what_can_mean_either_rover_is_asked_back(server: str) -> None:
    done = called("submit", "move", "1", server=server)
    assert done.status == 2
    assert done.error == (
        "mav-tasks: there is rovers 1, 2: name the one that is meant (--vehicle N)\n"
    )


def test_a_task_is_found_by_its_number_alone(server: str) -> None:
    submit = ("submit", "move", "1", "--in", "1h", "--vehicle", "2", "--json")
    (task,) = called(*submit, server=server).objects
    assert task["vehicle"] == 2
    (found,) = called("status", str(task["id"]), "--json", server=server).objects
    assert (found["id"], found["vehicle"]) == (task["id"], 2)
    assert called("modify", str(task["id"]), "--priority", "9", server=server).status == 0
    queues = called("queue", "--json", server=server).objects
    assert [queue["vehicle"] for queue in queues] == [1, 2]
    assert [[each["priority"] for each in queue["waiting"]] for queue in queues] == [[], [9]]
    assert called("cancel", str(task["id"]), server=server).status == 0
    gone = called("cancel", "9999", server=server)
    assert (gone.status, gone.error) == (1, "mav-tasks: no task 9999\n")


def test_stop_is_for_all_and_each_is_resumed(server: str) -> None:
    assert called("stop", server=server).status == 0
    rovers = called("queue", "--json", server=server).objects
    assert [rover["paused"] for rover in rovers] == ["stopped", "stopped"]
    assert called("resume", server=server).status == 2
    for number in ("1", "2"):
        assert called("resume", "--vehicle", number, server=server).status == 0
    assert [rover["paused"] for rover in called("queue", "--json", server=server).objects] == [
        *(None, None)
    ]
