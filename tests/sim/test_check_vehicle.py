"""The program itself, over real sockets, against the simulated rover as a process of its own."""

import csv
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rover_sim.check_vehicle.__main__ import main
from tests.kit.processes import process, wait_until

IN_README = "python -m rover_sim.check_vehicle udpout:127.0.0.1:14580"
CHECK = tuple(IN_README.split()[1:3])
READY = ("--boot", "none", "--peers", "all")
LIMIT = 50.0  # s


@contextmanager
def rover(folder: Path, *options: str) -> Iterator[str]:
    """Run a simulated rover; gives its URL."""
    arguments = ("-m", "rover_sim", "--port", "0", "--body", "kinematic", *READY, *options)
    with process(*arguments, folder=folder, name="rover") as running:
        found = running.wait_for(r"on udp 127\.0\.0\.1:(\d+)")
        yield f"udpout:127.0.0.1:{found[1]}"


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *CHECK, *arguments],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


def test_what_fails_is_said_again_at_the_end_and_in_the_exit_status(tmp_path: Path) -> None:
    with rover(tmp_path, "--persona", "px4", "--speed", "2") as url:
        only = ("--only", "identity", "--speed", "2", "--persona", "ardupilot")
        result = check(url, *only)
        as_json = check(url, *only, "--json")
    assert (result.returncode, as_json.returncode) == (1, 1)
    *_, again, summary = result.stdout.splitlines()
    assert again.startswith("FAIL    identity: autopilot: expected a ardupilot rover; seen:")
    assert "1 failed" in summary
    failed = [line for line in json.loads(as_json.stdout) if line["outcome"] == "FAIL"]
    assert [(line["group"], line["name"]) for line in failed] == [("identity", "autopilot")]


@pytest.mark.slow
def test_ctrl_c_while_it_drives_leaves_the_rover_standing(tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"

    def speed() -> float:
        text = truth.read_text(encoding="ascii")
        rows = list(csv.DictReader(text[: text.rfind("\n") + 1].splitlines()))
        return abs(float(rows[-1]["forward_speed"])) if rows else 0.0

    with rover(tmp_path, "--truth", str(truth)) as url:
        arguments = (*CHECK, url, "--drive", "--only", "driving")
        with process(*arguments, folder=tmp_path, name="check") as running:
            wait_until(lambda: speed() > 0.4, within=20, what="a rover at speed")
            running.popen.send_signal(signal.SIGINT)
            wait_until(lambda: speed() < 0.3, within=5, what="a rover that slows down")
            running.popen.send_signal(signal.SIGINT)  # again, from an impatient user
            assert running.popen.wait(15) == 130
            assert "driving: left behind: HOLD, disarmed" in running.text
        wait_until(lambda: speed() < 0.05, within=5, what="a rover that stands")


def test_bad_usage_is_refused_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, named in [
        (("nowhere",), "not a link"),
        (("udpout:127.0.0.1",), "not a link"),
        (("udpout:example.org:14550",), "not an IP address"),
        (("udpout:127.0.0.1:99999",), "not a port"),
        (("udpout:192.0.2.1:14550", "--drive"), "--insecure"),
        (("tcp:192.0.2.1:5760", "--arm"), "--insecure"),
        (("serial:/dev/ttyACM0:57600", "--arm"), "--insecure"),
        (("udpin:0.0.0.0:14550", "--drive"), "--insecure"),
        (("udpout:127.0.0.1:1", "--system-id", "0"), "--system-id"),
        (("udpout:127.0.0.1:1", "--speed", "0"), "--speed"),
        (("udpout:127.0.0.1:1", "--only", "everything"), "--only"),
        (("udpout:127.0.0.1:1", "--persona", "betaflight"), "--persona"),
    ]:
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        assert ended.value.code == 2
        assert named in capsys.readouterr().err.splitlines()[-1]
