"""The command line with two rovers: which of them is meant, and which need not be named."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.commands import session
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


NO_ROVER_CAN = "no rover can: rover 1: queue paused (operator); rover 2: STOP in force"
SESSION = f"""submit move 1 => 2 mav-tasks: the server has rovers 1, 2: choose one (--vehicle N)
submit move 1 --in 1h --vehicle 2 --json => "id": 1, … "vehicle": 2,
status 1 --json => "vehicle": 2,
modify 1 --priority 9 => 0
queue --json => "vehicle": 1, … "vehicle": 2, … "priority": 9
cancel 1 => 0
cancel 9999 => 1 mav-tasks: no task 9999
history => 0 rover 1: no finished task … rover 2: the last finished task
stop => 0 STOP is in force for every rover: no task runs until 'mav-tasks resume --all'
queue => rover 1: no task runs; queue paused (STOP) … rover 2: no task runs; queue paused (STOP)
doctor => queue paused (STOP): to let it run, use: mav-tasks resume --vehicle 1
resume --all => 0 rover 1: resumed … rover 2: resumed
ready => 0 ready: the server hears rovers 1, 2
pause => 2 mav-tasks: the server has rovers 1, 2: choose with --vehicle N or --all
pause --vehicle 2 => 0 rover 2: paused. To resume: mav-tasks resume --vehicle 2
queue --json => "paused": null … "paused": "operator"
pause --all --json => {{"done": "pause", "vehicle": 1}} … {{"done": "pause", "vehicle": 2}}
queue => rover 1: no task runs; queue paused (operator)
resume --vehicle 1 => 0 rover 1: resumed
resume --all => 0
stop --vehicle 2 => 0 STOP is in force for rover 2: no task runs until 'mav-tasks … --vehicle 2'
queue --json => "paused": null … "paused": "stopped"
resume --all => 0
submit wait 500 --every 600 --vehicle 2 => 0
queue => task 2 executing
cancel --series 2 => , and its series
pause --vehicle 1 => 0
stop --vehicle 2 => 0
submit move 3 --vehicle any => 1 mav-tasks: {NO_ROVER_CAN}
submit face 90 --vehicle any => 1 mav-tasks: {NO_ROVER_CAN}
submit goto 1 1 --local --vehicle any => name the rover, or give latitude and longitude
resume --all => 0
submit move 0.1 --vehicle any => 0 rover
vehicles => 1 … 2"""


def test_what_can_mean_either_rover_is_asked_back_and_what_is_for_all_is_for_all(
    server: str,
) -> None:
    session(server, SESSION)
