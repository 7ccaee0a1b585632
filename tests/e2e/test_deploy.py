"""tools/deploy: the unit is one for systemd, and what both files run is run here.

So are the guide's lines for systemd, below a folder of the test. Those for Docker are compared with
the Dockerfile: there is no Docker where the tests run.
"""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.commands import Done, mav_tasks
from tests.kit.processes import free_udp_ports, process

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "tools" / "deploy"
GUIDE = (ROOT / "mav_tasks" / "GUIDE.md").read_text(encoding="utf-8")
SERVICE = GUIDE[GUIDE.index("## Run it as a service\n") :]
INSTALL, DOCKER = re.findall(r"^```sh\n(.*?)^```", SERVICE, flags=re.MULTILINE | re.DOTALL)
UNIT = (DEPLOY / "mav-tasks.service").read_text(encoding="utf-8")
DOCKERFILE = (DEPLOY / "Dockerfile").read_text(encoding="utf-8")
PROGRAM = str(Path(sys.executable).with_name("mav-tasks"))


def test_systemd_takes_the_units(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd-analyze here")
    paths = []
    for source in DEPLOY.glob("*.service"):
        unit = source.read_text(encoding="utf-8").replace("/opt/mav-tasks/bin/mav-tasks", PROGRAM)
        unit = unit.replace("/opt/mav-tasks/README.md", str(ROOT / "README.md"))
        paths.append(str(tmp_path / source.name))
        Path(paths[-1]).write_text(unit, encoding="utf-8")
    assert len(paths) == 2
    command = ["systemd-analyze", "verify", "--recursive-errors=no", "--man=no", *paths]
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
        assert "does not hear rover 1 (silent for" in answers[-1].error
        server.end()
        assert server.popen.returncode == 0
    assert mav_tasks(*asked, server=url).status == 3


def command_that(does: str, path: Path) -> None:
    """Put a command in the place of one that changes the machine."""
    path.write_text(f"#!/usr/bin/env bash\n{does}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.slow
@pytest.mark.timeout(200)
def test_the_lines_of_the_guide_install_a_service_that_serves(tmp_path: Path) -> None:
    commands, machine = tmp_path / "commands", tmp_path / "machine"
    for folder in (commands, *(machine / each for each in ("opt", "etc/systemd/system"))):
        folder.mkdir(parents=True)
    command_that('[ "$1" = -u ] && shift 3; exec "$@"', commands / "sudo")
    for name in ("useradd", "systemctl"):
        command_that(f'echo "$@" >> {tmp_path / name}', commands / name)
    command_that(f'exec {sys.executable} "$@"', commands / "python3")

    def here(text: str) -> str:
        return re.sub(r"(?<=[\s=])/(opt|etc|var)/", rf"{machine}/\1/", text)

    paths = {**os.environ, "PATH": f"{commands}:{os.environ['PATH']}", "HOME": str(tmp_path)}
    run = ["bash", "-euc", here(INSTALL)]
    done = subprocess.run(run, cwd=ROOT, env=paths, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr

    (user,) = re.findall(r"^User=(.*)$", UNIT, re.MULTILINE)
    (state,) = re.findall(r"^StateDirectory=(.*)$", UNIT, re.MULTILINE)
    home = machine / "var/lib" / state
    assert (tmp_path / "useradd").read_text() == f"--system --home-dir {home} {user}\n"
    assert (tmp_path / "systemctl").read_text() == "enable --now mav-tasks\n"
    installed = machine / "etc/systemd/system/mav-tasks.service"
    if systemctl := shutil.which("systemctl"):
        offline = [systemctl, f"--root={machine}", "enable", "mav-tasks"]
        subprocess.run(offline, check=True, capture_output=True)
        wanted = installed.parent / "multi-user.target.wants/mav-tasks.service"
        assert wanted.is_symlink()

    home.mkdir(parents=True)  # as StateDirectory= does
    (started,) = re.findall(r"^ExecStart=(.*)$", here(installed.read_text()), re.MULTILINE)
    client, rover = free_udp_ports(2)
    links = ["--client", f"udpin:127.0.0.1:{client}", "--no-push"]
    links += ["--vehicle", f"udpin:127.0.0.1:{rover}"]
    program, *arguments = shlex.split(started)
    python = str(Path(program).with_name("python"))
    serve = ("-m", "mav_tasks.cli", *arguments, *links)
    with process(*serve, folder=tmp_path, name="serve", python=python) as server:
        server.wait_for("tasks.sqlite3")
        server.end()
        assert server.popen.returncode == 0
    assert (home / "tasks.sqlite3").is_file()

    (keys,) = re.findall(r"`(sudo -u [^`]*keys) list`", SERVICE)
    for command in ("add tester --role operator", "list"):
        line, secret = f"{here(keys)} {command}", "a passphrase for a test"
        done = subprocess.run(
            ["bash", "-euc", line],
            cwd=tmp_path,
            env=paths,
            input=secret,
            text=True,
            capture_output=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    assert "tester" in done.stdout
    assert list(tmp_path.rglob("keys.toml"))


def test_the_lines_for_docker_fit_the_dockerfile() -> None:
    build, run = (shlex.split(line) for line in DOCKER.splitlines())
    (volume,) = re.findall(r"^VOLUME (.*)$", DOCKERFILE, re.MULTILINE)
    assert build == ["docker", "build", "-f", "tools/deploy/Dockerfile", "-t", run[-1], "."]
    assert run[:4] == ["docker", "run", "--network", "host"]
    assert run[4:6] == ["-v", f"mav-tasks:{volume}"]
