"""./tools/demo, as the README has it."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.kit.processes import wait_until
from tests.kit.volume import some

ROOT = Path(__file__).resolve().parents[2]


def demo(
    *options: str, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run ./tools/demo to its end."""
    return subprocess.run(
        [str(ROOT / "tools/demo"), *options],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env=environment,
    )


@pytest.mark.slow
@pytest.mark.timeout(150)
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
@pytest.mark.timeout(150)
def test_in_the_fleet_s_demo_a_gateway_is_killed_and_its_rovers_go_on() -> None:
    done = demo("--fleet", "--body", "kinematic")

    assert done.returncode == 0, done.stdout + done.stderr
    assert "gateway north has rovers 1, 2, 3, 4" in done.stdout
    assert "gateway south has no rover" in done.stdout
    assert re.search(r"gateway south has rovers 1, 2, 3, 4 after \d\.\d s", done.stdout)
    ended = re.findall(r"rover (\d): task \d+ (\w+)", done.stdout)
    assert ended == [(str(rover), "completed") for rover in (1, 2, 3, 4)]


@pytest.mark.timeout(60)
def test_a_recorded_demo_decides_the_same_again(tmp_path: Path) -> None:
    done = demo("--fast", "--body", "kinematic", "--record", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    (record,) = tmp_path.iterdir()
    replayed = subprocess.run(
        [sys.executable, "-m", "mav_tasks.cli", "replay", str(record)],
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
        env={**os.environ, "PYTHONHASHSEED": "12345"},
    )
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert [line for line in replayed.stdout.splitlines() if " completed; " in line]
    assert replayed.stdout.splitlines()[-1].startswith("same: ")


def test_the_window_cannot_be_had_in_virtual_time() -> None:
    done = demo("--gui", "--fast")
    assert done.returncode == 2
    assert "--gui" in done.stdout


@pytest.mark.timeout(60)
def test_a_part_that_cannot_run_is_named_at_once(tmp_path: Path) -> None:
    (tmp_path / "pybullet.py").write_text("raise ImportError('not here')\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    for options in (("--body", "bullet"), ("--fast", "--body", "bullet")):
        done = demo(*options, environment=environment)
        assert done.returncode == 2, done.stdout + done.stderr
        assert "pip install pybullet" in done.stdout.strip().splitlines()[-1]
        assert "Traceback" not in done.stderr


@pytest.mark.timeout(60)
def test_without_matplotlib_and_pybullet_it_runs_without_a_picture_and_says_so(
    tmp_path: Path,
) -> None:
    for name in ("matplotlib", "pybullet"):
        (tmp_path / f"{name}.py").write_text("raise ImportError('not here')\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = demo("--fast", "--output", str(tmp_path), environment=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line for line in done.stdout.splitlines() if line.startswith("demo: ")]
    kinematic, no_picture, last = lines
    assert "the rover is the kinematic one" in kinematic
    assert no_picture.endswith("not installed (pip install matplotlib)")
    assert last == "demo: all correct"
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.timeout(60)
@pytest.mark.parametrize("after", [0.3, 4.0])
def test_ctrl_c_ends_it_without_a_traceback(after: float) -> None:
    running = subprocess.Popen(
        [str(ROOT / "tools/demo"), "--body", "kinematic"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    with pytest.raises(subprocess.TimeoutExpired):
        running.wait(after)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to all of the group
    output, _ = running.communicate(timeout=20)
    assert running.returncode in (130, -signal.SIGINT)
    assert "Traceback" not in output


@pytest.mark.slow
@pytest.mark.timeout(150)
def test_the_demo_with_the_web_page_goes_on_until_ctrl_c(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "rover_sim.demo", "--web", "--body", "kinematic"]
    log = tmp_path / "demo.log"
    with log.open("wb") as output:
        it = subprocess.Popen(
            [*command, "--output", str(tmp_path)],
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env={name: value for name, value in os.environ.items() if "DISPLAY" not in name},
        )
    try:
        text = log.read_text
        wait_until(lambda: "press Ctrl-C" in text(), within=90, what=text)
        found = re.search(r"web page: (\S+)/", text())
        assert found is not None
        tasks = httpx.get(f"{found[1]}/api/v1/vehicles/1/history").json()["tasks"]
        assert [task["state"] for task in tasks] == ["completed"] * 3
        os.killpg(it.pid, signal.SIGINT)  # as a terminal does
        assert it.wait(20) == 0, text()
        assert "demo: all correct" in text()
    finally:
        it.kill()
        it.wait()
    refused = demo("--web", "--fast")
    assert refused.returncode == 2
    assert "--web needs real time" in refused.stdout
