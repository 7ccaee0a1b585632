"""The command line with two rovers: which of them is meant, and which need not be named."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.commands import called
from tests.kit.processes import free_udp_ports, frozen, process, wait_until


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


@pytest.mark.parametrize("action", ["pause", "resume"])
def test_a_pause_of_several_says_how_to_choose(server: str, action: str) -> None:
    done = called(action, server=server)
    assert (done.status, done.output) == (2, "")
    assert done.error == (
        "mav-tasks: the server has rovers 1, 2: choose with --vehicle N or --all\n"
    )
    both = called(action, "--all", "--vehicle", "1", server=server)
    assert (both.status, both.error) == (
        *(2, "mav-tasks: --all and --vehicle 1: choose one of them\n"),
    )
    assert paused(server) == [None, None]


def test_a_silent_rover_keeps_no_other_from_being_paused(tmp_path: Path) -> None:
    client, *rovers = free_udp_ports(3)
    serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{client}", "--no-push"]
    serve += [part for port in rovers for part in ("--vehicle", f"udpout:127.0.0.1:{port}")]
    server = f"udpout:127.0.0.1:{client}"

    def sim(number: int) -> tuple[str, ...]:
        port = str(rovers[number - 1])
        return (
            "-m",
            "rover_sim",
            "--port",
            port,
            "--body",
            "kinematic",
            "--system-id",
            str(number),
        )

    with (
        process(*sim(1), folder=tmp_path, name="first"),
        process(*sim(2), folder=tmp_path, name="second") as second,
        process(*serve, "--store", ":memory:", folder=tmp_path, name="server") as running,
    ):
        running.wait_for("rover 1: found")
        running.wait_for("rover 2: found")
        heard = called("ready", server=server)
        assert (heard.status, heard.lines) == (0, ["ready: the server hears rovers 1, 2"])
        with frozen(second):
            running.wait_for("rover 2: silent")
            half = called("ready", "--json", server=server)
            assert half.status == 1
            assert re.fullmatch(
                r"mav-tasks: the server answers, but does not hear rover 2"
                r" \(silent for [\d.]+s\)\n",
                half.error,
            )
            assert half.objects[0]["ready"] is False
            assert [each["heard"] for each in half.objects[0]["rovers"]] == [True, False]
            one = called("ready", "--vehicle", "1", server=server)
            assert (one.status, one.lines) == (0, ["ready: the server hears rover 1"])
            done = called("pause", "--all", server=server)
            assert done.status == 1
            assert done.lines == ["rover 1: paused. To resume: mav-tasks resume --vehicle 1"]
            assert done.error.startswith("mav-tasks: rover 2: paused, but")
            headlines = [line for line in called("queue", server=server).lines if "rover" in line]
            assert "rover 2 (silent for" in headlines[1]


def test_a_server_that_does_not_answer_is_not_ready() -> None:
    (nowhere,) = free_udp_ports(1)
    done = called("ready", "--within", "0.3", server=f"udpout:127.0.0.1:{nowhere}")
    assert (done.status, done.output) == (3, "")
    assert "no task server answered" in done.error


def places(server: str) -> list[tuple[float, float]]:
    """Return where each rover is, once the command has waited long enough to be told."""
    found: list[tuple[float, float]] = []

    def are_told() -> bool:
        rovers = called("vehicles", "--json", server=server).objects
        found[:] = [(rover["latitude"], rover["longitude"]) for rover in rovers]
        return None not in [number for place in found for number in place]

    wait_until(are_told, within=20)
    return found


def test_any_rover_is_the_free_one_and_then_the_nearest_one(server: str) -> None:
    submit = "submit move 3 --vehicle any"
    first = called(*submit.split(), server=server)
    assert re.match(r"rover 1: task \d+: free, battery 100% \(rover 2: begins in ", first.lines[0])
    second = ("submit", "move", "0.3", "--vehicle", "any", "--nonce", "4711", "--json")
    (task,) = called(*second, server=server).objects
    assert task["vehicle"] == 2
    (same,) = called(*second, server=server).objects
    assert (same["id"], same["vehicle"]) == (task["id"], 2)
    busy = called("submit", "wait", "1s", "--vehicle", "any", "--wait", server=server)
    assert busy.status == 0
    number = re.search(r"task (\d+)", first.lines[0])
    assert number is not None
    assert called("status", number[1], "--wait", server=server).status == 0
    for rover, (latitude, longitude) in enumerate(places(server), 1):
        there = (str(latitude), str(longitude), "--global", "--vehicle", "any", "--wait", "--json")
        *_, done = called("submit", "goto", *there, server=server).objects
        assert (done["vehicle"], done["state"]) == (rover, "completed")


def test_if_no_rover_can_the_command_line_says_of_each_one_why(server: str) -> None:
    assert called("pause", "--vehicle", "1", server=server).status == 0
    assert called("stop", "--vehicle", "2", server=server).status == 0
    done = called("submit", "move", "1", "--vehicle", "any", server=server)
    assert (done.status, done.error) == (
        1,
        "mav-tasks: no rover can: rover 1: queue paused (operator); rover 2: STOP in force\n",
    )
    mission = called("submit", "face", "90", "--vehicle", "any", server=server)
    assert (mission.status, mission.error) == (done.status, done.error)
    local = called("submit", "goto", "1", "1", "--local", "--vehicle", "any", server=server)
    assert "name the rover, or give latitude and longitude" in local.error
    assert called("resume", "--all", server=server).status == 0


def test_any_is_for_new_tasks_only(server: str) -> None:
    for command in (("queue",), ("stop",), ("cancel", "1")):
        done = called(*command, "--vehicle", "any", server=server)
        assert (done.status, "--vehicle" in done.error) == (2, True)
    staged = called("mission", "upload", "x.plan", "--stage", "--vehicle", "any", server=server)
    assert staged.status == 2
    assert "name it with --vehicle N" in staged.error
