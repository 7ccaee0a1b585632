"""./tools/demo, as the README has it."""

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.kit.processes import OF_A_BUSY_MACHINE, environment_with, wait_until
from tests.kit.volume import some

ROOT = Path(__file__).resolve().parents[2]


def demo(*options: str) -> subprocess.CompletedProcess[str]:
    """Run ./tools/demo to its end."""
    return subprocess.run(
        [str(ROOT / "tools/demo"), *options],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
        env=environment_with(**OF_A_BUSY_MACHINE),
    )


@pytest.mark.slow
@pytest.mark.timeout(240)
@pytest.mark.parametrize(
    "options", some([(), ("--fast",), ("--fast", "--body", "kinematic")], 0, 2)
)
def test_the_demo_shows_three_tasks_and_finds_all_as_it_should_be(options: tuple[str, ...]) -> None:
    done = demo(*options)

    assert done.returncode == 0, done.stdout + done.stderr
    acks = re.findall(r"COMMAND_ACK ACCEPTED: (\w+) .* is task (\d+)", done.stdout)
    assert acks == [("forward", "1"), ("rotate", "2"), ("forward", "3")]
    rows = re.findall(r"│ +(\d) │ (\w+) +│ +(\d) │ +(\d) │ (\w+) ", done.stdout)
    assert rows == [
        ("1", "forward", "3", "1", "completed"),
        ("2", "rotate", "8", "2", "completed"),
        ("3", "forward", "5", "3", "completed"),
    ]
    picture = re.search(r"picture of the track: (\S+)", done.stdout)
    assert picture is not None
    assert Path(picture[1]).read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.timeout(240)
def test_in_the_fleet_s_demo_a_gateway_is_killed_and_its_rovers_go_on() -> None:
    done = demo("--fleet", "--body", "kinematic")

    assert done.returncode == 0, done.stdout + done.stderr
    assert "gateway north has rovers 1, 2, 3, 4" in done.stdout
    assert "gateway south has no rover" in done.stdout
    assert re.search(r"gateway south has rovers 1, 2, 3, 4 after \d\.\d s", done.stdout)
    ended = re.findall(r"rover (\d): task \d+ (\w+)", done.stdout)
    assert ended == [(str(rover), "completed") for rover in (1, 2, 3, 4)]


@pytest.mark.timeout(60)
@pytest.mark.parametrize("after", [0.0, 4.0])
def test_ctrl_c_ends_it_without_a_traceback(after: float) -> None:
    running = subprocess.Popen(
        [str(ROOT / "tools/demo"), "--body", "kinematic"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    mapped = Path(f"/proc/{running.pid}/maps")  # Python has begun, and imports
    wait_until(lambda: "_asyncio" in mapped.read_text(), within=30)
    with pytest.raises(subprocess.TimeoutExpired):
        running.wait(after)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to all of the group
    output, _ = running.communicate(timeout=20)
    assert running.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in output
