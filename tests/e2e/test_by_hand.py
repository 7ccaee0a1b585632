"""`mav-tasks sim` and `mav-tasks serve` by hand, without a flag, on their own ports."""

import fcntl
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.kit.processes import process


@pytest.fixture(autouse=True)
def default_ports() -> Iterator[None]:
    """Have the default ports for this test alone: another worker may run the other test."""
    with (Path(tempfile.gettempdir()) / "mav-tasks-default-ports.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.mark.pybullet
def test_without_a_flag_the_server_finds_the_rover(tmp_path: Path) -> None:
    with (
        process("-m", "mav_tasks.cli", "sim", folder=tmp_path, name="sim") as sim,
        process("-m", "mav_tasks.cli", "serve", folder=tmp_path, name="serve") as serve,
    ):
        sim.wait_for("rover 1 .*14580")
        serve.wait_for("clients on udpin:127.0.0.1:14560")
        serve.wait_for("rover 1: found")
        assert serve.end() < 1.5
        assert serve.popen.returncode == 0
        sim.end()
        assert sim.popen.returncode == 0


def test_several_rovers_are_all_found(tmp_path: Path) -> None:
    several = ("sim", "--count", "3", "--body", "kinematic")
    with (
        process("-m", "mav_tasks.cli", *several, folder=tmp_path, name="sim"),
        process("-m", "mav_tasks.cli", "serve", folder=tmp_path, name="serve") as serve,
    ):
        for number in (1, 2, 3):
            serve.wait_for(f"rover {number}: found")
