"""The program itself, over real sockets, against the simulated rover as a process of its own."""

import subprocess
import sys
from pathlib import Path

from tests.kit.processes import process

IN_README = "python -m rover_sim.check_vehicle udpout:127.0.0.1:14580"
CHECK = tuple(IN_README.split()[1:3])
READY = ("--boot", "none", "--peers", "all", "--persona", "px4")
LIMIT = 50.0  # s


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *CHECK, *arguments],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


def test_a_rover_is_checked_over_udp(tmp_path: Path) -> None:
    arguments = ("-m", "rover_sim", "--port", "0", "--body", "kinematic", *READY)
    with process(*arguments, folder=tmp_path, name="rover") as running:
        found = running.wait_for(r"on udp 127\.0\.0\.1:(\d+)")
        done = check(f"udpout:127.0.0.1:{found[1]}", "--only", "answers")
    assert done.returncode == 0, done.stdout + done.stderr
    *lines, summary = done.stdout.splitlines()
    assert "ok: answers: a command for another system: no answer within 1 s (no answer .*)" in lines
    assert summary == "0 failed"


def test_bad_usage_is_refused_by_name() -> None:
    for arguments, named in [
        (("nowhere",), "nowhere"),
        (("udpout:127.0.0.1:1", "--only", "everything"), "--only"),
        (("udpout:192.0.2.1:14550", "--arm"), "--insecure"),
        (("serial:/dev/ttyACM0:57600", "--arm"), "--insecure"),
        (("--rover", "boat"), "--rover"),
    ]:
        done = check(*arguments)
        assert done.returncode == 2
        assert named in done.stderr.splitlines()[-1]
