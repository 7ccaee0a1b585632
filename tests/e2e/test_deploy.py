"""tools/deploy: the unit is one for systemd, and what both files run is run here.

So are the guide's lines for systemd, below a folder of the test. Those for Docker are compared with
the Dockerfile: there is no Docker where the tests run.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kit.processes import free_udp_ports, process

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / "tools" / "deploy"
GUIDE = (ROOT / "mav_tasks/guide/running.md").read_text(encoding="utf-8")
SERVICE = GUIDE[GUIDE.index("## As a service\n") :]
INSTALL, DOCKER = re.findall(r"^```sh\n(.*?)^```", SERVICE, flags=re.MULTILINE | re.DOTALL)
UNIT = (DEPLOY / "mav-tasks.service").read_text(encoding="utf-8")
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

    (as_user,) = re.findall(r"`(sudo -u [^`]*) …`", SERVICE)
    keys = f"{as_user} {program} keys"
    for command in ("add tester --role operator", "list"):
        line, secret = f"{keys} {command}", "a passphrase for a test"
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
