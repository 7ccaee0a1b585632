"""The command line with two rovers: which of them is meant, and which need not be named."""

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.commands import called
from tests.kit.processes import free_udp_ports, process


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder: Path = tmp_path_factory.mktemp("fleet")
    client, rover = free_udp_ports(2)
    ready = ("--boot", "none")
    sim = ("-m", "rover_sim", "--port", str(rover), "--body", "kinematic", "--count", "2", *ready)
    serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{client}", "--no-push"]
    serve += ["--vehicle", f"udpout:127.0.0.1:{rover}", "--store", ":memory:"]
    with (
        process(*sim, folder=folder, name="rovers"),
        process(*serve, folder=folder, name="server") as running,
    ):
        running.wait_for("rover 1: found")
        running.wait_for("rover 2: found")
        yield f"udpout:127.0.0.1:{client}"


def test_what_can_mean_either_rover_is_asked_back(server: str) -> None:
    done = called("submit", "move", "1", server=server)
    assert done.status == 2
    assert done.error == ("mav-tasks: the server has rovers 1, 2: choose one (--vehicle N)\n")


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


def paused(server: str) -> list[str | None]:
    """Return why the queue of each rover is paused."""
    return [rover["paused"] for rover in called("queue", "--json", server=server).objects]


def test_stop_pause_and_resume_are_for_one_rover_or_for_all(server: str) -> None:
    assert called("stop", server=server).status == 0
    assert paused(server) == ["stopped", "stopped"]
    all_go_on = called("resume", "--all", server=server)
    assert all_go_on.lines == ["rover 1: resumed", "rover 2: resumed"]
    assert paused(server) == [None, None]
    assert called("pause", "--vehicle", "2", server=server).lines == [
        "rover 2: paused. To resume: mav-tasks resume --vehicle 2"
    ]
    assert paused(server) == [None, "operator"]
    done = called("pause", "--all", "--json", server=server).objects
    assert done == [{"done": "pause", "vehicle": 1}, {"done": "pause", "vehicle": 2}]
    assert paused(server) == ["operator", "operator"]
    assert called("resume", "--vehicle", "1", server=server).lines == ["rover 1: resumed"]
    assert called("resume", "--all", server=server).status == 0
    one = called("stop", "--vehicle", "2", server=server)
    assert one.lines == [
        "STOP is in force for rover 2: no task runs until 'mav-tasks resume --vehicle 2'"
    ]
    assert paused(server) == [None, "stopped"]
    assert called("resume", "--all", server=server).status == 0


def test_if_no_rover_can_the_command_line_says_of_each_one_why(server: str) -> None:
    assert called("pause", "--vehicle", "1", server=server).status == 0
    assert called("stop", "--vehicle", "2", server=server).status == 0
    done = called(*shlex.split("submit move 3 --vehicle any"), server=server)
    assert (done.status, done.error) == (
        1,
        "mav-tasks: no rover can: rover 1: queue paused (operator); rover 2: STOP in force\n",
    )
    mission = called("submit", "face", "90", "--vehicle", "any", server=server)
    assert (mission.status, mission.error) == (done.status, done.error)
    local = called("submit", "goto", "1", "1", "--local", "--vehicle", "any", server=server)
    assert "name the rover, or give latitude and longitude" in local.error
    assert called("resume", "--all", server=server).status == 0
