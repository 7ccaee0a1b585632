"""tools/deploy: the unit is one for systemd, and what both files run is run here."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.commands import Done, mav_tasks
from tests.kit.processes import free_udp_ports, process

DEPLOY = Path(__file__).resolve().parents[2] / "tools" / "deploy"
UNIT = (DEPLOY / "mav-tasks.service").read_text(encoding="utf-8")
DOCKERFILE = (DEPLOY / "Dockerfile").read_text(encoding="utf-8")
PROGRAM = str(Path(sys.executable).with_name("mav-tasks"))


def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze here")
    unit = UNIT.replace("/opt/mav-tasks/bin/mav-tasks", PROGRAM)
    unit = unit.replace("/opt/mav-tasks/README.md", str(DEPLOY.parents[1] / "README.md"))
    path = tmp_path / "mav-tasks.service"
    path.write_text(unit, encoding="utf-8")
    command = ["systemd-analyze", "verify", "--recursive-errors=no", "--man=no", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=30)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_health_check_of_the_container_asks_the_server_of_the_unit(tmp_path: Path) -> None:
    (started,) = re.findall(r"^ExecStart=/opt/mav-tasks/bin/mav-tasks (.*)$", UNIT, re.MULTILINE)
    (check,) = re.findall(r"^HEALTHCHECK .*CMD (\[.*\])$", DOCKERFILE, re.MULTILINE)
    (entry,) = re.findall(r"^ENTRYPOINT (\[.*\])$", DOCKERFILE, re.MULTILINE)
    (command,) = re.findall(r"^CMD (\[.*\])$", DOCKERFILE, re.MULTILINE)
    assert json.loads(entry) == ["mav-tasks"]
    assert json.loads(command) == shlex.split(started)[:1] == ["serve"]
    program, *asked = json.loads(check)
    assert program == "mav-tasks"

    client, rover = free_udp_ports(2)
    (tmp_path / "config.toml").write_text(
        f'[links]\nclients = ["udpin:127.0.0.1:{client}"]\npush = []\n'
        f'vehicles = ["udpout:127.0.0.1:{rover}"]\n'
    )
    started = started.replace("/etc/mav-tasks", str(tmp_path))
    started = started.replace("/var/lib/mav-tasks", str(tmp_path))
    url = f"udpout:127.0.0.1:{client}"
    sim = ("-m", "rover_sim", "--port", str(rover), "--body", "kinematic")
    serve = ("-m", "mav_tasks.cli", *shlex.split(started))
    with process(*serve, folder=tmp_path, name="serve") as server:
        with process(*sim, folder=tmp_path, name="sim"):
            server.wait_for("rover 1: found")
            assert mav_tasks(*asked, server=url).status == 0
        # The rover has gone: the server is there, and says so.
        answers: list[Done] = []
        while not answers or answers[-1].status == 0:
            answers.append(mav_tasks(*asked, server=url))
            assert len(answers) < 50
        assert answers[-1].status == 1
        assert "rover 1 is silent for" in answers[-1].error
        server.end()
        assert server.popen.returncode == 0
    assert mav_tasks(*asked, server=url).status == 3
