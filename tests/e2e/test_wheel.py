"""The wheel, installed into an empty environment, has what each of its extras promises."""

import json
import subprocess
import sys
import venv
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from tests.kit.plugin_example import EXAMPLE
from tests.kit.processes import Process, environment_with, free_udp_ports, process

ROOT = Path(__file__).resolve().parents[2]


LIMIT = 150.0  # s, for one command


def built(dist: Path) -> Path:
    """Return the wheel of this tree."""
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(dist)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = dist.glob("mav_tasks-*.whl")
    return wheel


def install(python: str, what: str) -> None:
    """Install something into an environment."""
    subprocess.run([python, "-m", "pip", "install", "-q", what], check=True)


def run(python: str, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run something to its end, away from this tree."""
    return subprocess.run(
        [python, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
        env=environment_with(),
    )


@contextmanager
def serving(python: str, folder: Path, *sim_options: str) -> Iterator[tuple[Process, str]]:
    """Run a rover and a server; gives the rover's process and the server's URL."""
    rover_port, client_port = free_udp_ports(2)
    sim = ("-m", "mav_tasks.cli", "sim", "--port", str(rover_port), *sim_options)
    serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{client_port}"]
    serve += ["--no-push", "--vehicle", f"udpout:127.0.0.1:{rover_port}"]
    serve += ["--store", str(folder / "tasks.sqlite3")]
    with (
        process(*sim, folder=folder, name="sim", python=python) as rover,
        process(*serve, folder=folder, name="serve", python=python) as server,
    ):
        server.wait_for("rover 1: found")
        yield rover, f"udpout:127.0.0.1:{client_port}"


@pytest.mark.slow
@pytest.mark.pybullet
@pytest.mark.timeout(600)
def test_the_wheel_serves_by_itself_and_has_more_with_its_extras(tmp_path: Path) -> None:
    wheel = built(tmp_path / "dist")
    venv.create(tmp_path / "venv", with_pip=True)
    python = str(tmp_path / "venv" / "bin" / "python")

    install(python, str(wheel))
    without_extras(python, tmp_path)

    install(python, f"{wheel}[testing]")
    with_testing(python, tmp_path)


def without_extras(python: str, folder: Path) -> None:
    """A rover is served and given tasks; the real body says what it needs."""
    for extra in ("pybullet", "numpy", "matplotlib", "pytest", "mavsdk"):
        assert run(python, "-c", f"import {extra}", folder=folder).returncode == 1, extra

    path = run(python, "-m", "mav_tasks.cli", "dialect", "--path", folder=folder).stdout.strip()
    assert ROOT not in Path(path).parents
    for name in ("mav_tasks.xml", "base_additions.xml"):
        assert (Path(path) / name).read_bytes() == (ROOT / "dialects" / name).read_bytes()

    told = "from importlib.metadata import metadata; print(metadata('mav-tasks').get_payload())"
    readme = run(python, "-c", told, folder=folder).stdout
    assert "## Ten minutes" in readme
    assert "](" not in readme, "links of a repository that a reader of the wheel has not"
    for document in ("README.md", "guide/clients.md", "CHANGELOG.md"):
        assert (Path(path).parents[1] / document).is_file()
    assert (Path(path).parents[1] / "metrics" / "grafana.json").is_file()

    sim = ("-m", "mav_tasks.cli", "sim", "--port", "0")
    refused = run(python, *sim, "--body", "bullet", folder=folder)
    assert refused.returncode == 2, refused.stdout
    assert "pip install pybullet numpy" in refused.stderr

    with serving(python, folder) as (rover, url):
        rover.wait_for(r"rover 1 \(ardupilot, kinematic\)")
        ask = partial(run, python, "-m", "mav_tasks.cli", folder=folder)
        done = ask("submit", "move", "0.3", "--wait", "--server", url)
        assert (done.returncode, done.stderr) == (0, "")
        assert "completed" in done.stdout
        later = ask("submit", "move", "1", "--in", "1h", "--server", url)
        assert (later.returncode, later.stdout.strip()) == (0, "rover 1: task 2")
        queue = ask("queue", "--json", "--server", url)
        assert [task["id"] for task in json.loads(queue.stdout)["waiting"]] == [2]


def with_testing(python: str, folder: Path) -> None:
    """The real body drives, and a stranger's test passes; the demo runs without its picture."""
    (folder / "test_patrol.py").write_text(EXAMPLE, encoding="utf-8")
    options = ("-W", "error", "-m", "pytest", "-q", "--strict-markers", "test_patrol.py")
    tested = run(python, *options, folder=folder)
    assert tested.returncode == 0, tested.stdout + tested.stderr

    with serving(python, folder) as (rover, _):
        rover.wait_for(r"rover 1 \(ardupilot, bullet\)")

    demo = run(python, "-m", "mav_tasks.cli", "demo", "--fast", folder=folder)
    assert demo.returncode == 0, demo.stdout + demo.stderr
    assert "pip install matplotlib" in demo.stdout
