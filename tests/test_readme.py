"""README.md does not promise what is not there: its examples run, its commands are run by tests."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.mavproxy import mavproxy
from tests.kit.processes import stand

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
CONTRACT = (ROOT / "dialects" / "README.md").read_text(encoding="utf-8")

#: each command of the README, and what runs it
COMMANDS = {
    "./tools/demo": "tests/e2e/test_demo.py",
    "./tools/test": ".ci/run",
    "mav-tasks sim": "tests/e2e/test_by_hand.py",
    "mav-tasks serve": "tests/e2e/test_by_hand.py",
    "python -m rover_sim.check_vehicle udpout:127.0.0.1:14580": "tests/sim/test_check_vehicle.py",
}


#: what MAVProxy says after each of the lines shown
MAVPROXY_ANSWERS = (
    "AP: Task 1 done",
    "MISSION_ACK: TYPE_MISSION: ACCEPTED",
    "AP: Task 2 done",
    "Set vehicle",
    "",
    "Set vehicle",
)
WAY = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363262\t149.165237\t584\t1
1\t0\t3\t16\t0\t0\t0\t0\t-35.363253\t149.165237\t0\t1
"""


def blocks(language: str, text: str = README) -> list[str]:
    """Give the fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


#: each example by itself, and what it prints; those of the wire contract go on from one another
EXAMPLES = [
    *(pytest.param(block, "task 1", id=block.split("\n")[0]) for block in blocks("python")),
    pytest.param("".join(blocks("python", CONTRACT)), "completed", id="dialects/README.md"),
]


def test_every_command_is_run_somewhere() -> None:
    shown = re.findall(r"^\$ (.*)$", "".join(blocks("console")), flags=re.MULTILINE)
    assert set(shown) == set(COMMANDS)
    for command, where in COMMANDS.items():
        assert command.removeprefix("mav-tasks ").strip("./") in (ROOT / where).read_text()


@pytest.mark.parametrize(("example", "printed"), EXAMPLES)
def test_example_runs(example: str, printed: str, tmp_path: Path) -> None:
    with stand(tmp_path) as it:
        example = example.replace("14560", str(it.client_port))
        example = example.replace("14540", str(it.push_port))
        done = subprocess.run(
            [sys.executable, "-c", example],
            capture_output=True,
            text=True,
            timeout=50,
            check=False,
            env={name: value for name, value in os.environ.items() if name != "MAVLINK20"},
        )
    assert done.returncode == 0, done.stderr
    assert printed in done.stdout.lower()


def test_mavproxy_lines_do_what_they_say(tmp_path: Path) -> None:
    (tmp_path / "way.txt").write_text(WAY, encoding="ascii")
    command = re.search(r"`mavproxy\.py --master udpout:127\.0\.0\.1:14560 (.*?)`", README)
    assert command is not None
    (lines,) = blocks("mavproxy")
    with (
        stand(tmp_path) as it,
        mavproxy(it.client_port, tmp_path, *command[1].split()) as session,
    ):
        session.wait_for(r"Received \d+ parameters\n.*mav\.parm", within=15)
        for line, answer in zip(lines.splitlines(), MAVPROXY_ANSWERS, strict=True):
            session.ask(line, answer, within=20)
            if line.startswith("param set"):  # it says nothing, and sends it a moment later
                it.server.wait_for("parameter {2}: {3}".format(*line.split()))
        assert session.complaints() == []


def test_every_path_named_exists() -> None:
    named = re.findall(r"`(?:\./)?((?:tools|tests|dialects|sim)/[\w./]*)`", README)
    named += re.findall(r"\]\((?!https?:)([^)#]+)\)", README)
    assert named
    for path in named:
        assert (ROOT / path).exists(), path
