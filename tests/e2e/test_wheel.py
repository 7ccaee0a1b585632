"""The wheel, installed into an empty environment, has all that the demo's parts need."""

import subprocess
import sys
import venv
from pathlib import Path

import pytest

from tests.kit.processes import free_udp_ports, process

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.pybullet
@pytest.mark.timeout(600)
def test_the_wheel_runs_server_and_rover_in_an_empty_environment(tmp_path: Path) -> None:
    dist = tmp_path / "dist"
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(dist)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = dist.glob("mav_tasks-*.whl")
    venv.create(tmp_path / "venv", with_pip=True)
    python = str(tmp_path / "venv" / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "-q", f"{wheel}[sim]"], check=True)

    rover_port, client_port = free_udp_ports(2)
    sim = ("-m", "mav_tasks.cli", "sim", "--port", str(rover_port))
    serve = ["-m", "mav_tasks.cli", "serve", "--client", f"udpin:127.0.0.1:{client_port}"]
    serve += ["--no-push", "--vehicle", f"udpout:127.0.0.1:{rover_port}"]
    serve += ["--store", str(tmp_path / "tasks.sqlite3")]
    with (
        process(*sim, folder=tmp_path, name="sim", python=python) as rover,
        process(*serve, folder=tmp_path, name="serve", python=python) as server,
    ):
        rover.wait_for(r"rover 1 \(ardupilot, bullet\)")
        server.wait_for("vehicle 1: found")
