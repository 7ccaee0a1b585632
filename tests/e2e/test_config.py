"""The configuration with real processes, above all changed while a rover drives."""

import os
import pty
import re
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from mav_tasks.store import open_store
from mav_tasks.tasks.events import ParameterSet
from tests.e2e.test_usage import run
from tests.kit.commands import Done, mav_tasks
from tests.kit.processes import (
    Process,
    environment_with,
    free_udp_ports,
    process,
    stand,
    submit,
    wait_until,
)


def serving(folder: Path, *options: str) -> tuple[str, ...]:
    """A server on ports of its own, with nobody there."""
    client, rover = free_udp_ports(2)
    return (
        *("-m", "mav_tasks.cli", "serve", "--no-push", "--store", ":memory:", *options),
        *("--client", f"udpin:127.0.0.1:{client}", "--vehicle", f"udpout:127.0.0.1:{rover}"),
    )


def test_sighup_changes_what_can_change_while_a_rover_drives(tmp_path: Path) -> None:
    path, store = tmp_path / "c.toml", tmp_path / "tasks.sqlite3"
    path.write_text("[driving]\nspeed = 0.4\n", encoding="utf-8")
    options = ("--config", str(path), "--set", "watch.stuck=20")
    with closing(open_store(str(store))) as earlier:
        earlier.append([ParameterSet("TSK_QUOTA", -1.0, "a", 1.0)])
    with stand(tmp_path, *options, serve_store=str(store)) as it:
        it.server.wait_for(f"configuration {re.escape(str(path))}\n")
        it.server.wait_for("parameters of an earlier run: TSK_QUOTA -1")
        ignored = "mav-tasks: parameter of an earlier run ignored: TSK_QUOTA -1: not in 1..100000\n"
        it.server.wait_for(ignored)
        client = it.connect()
        it.drive(client, 1.0)
        path.write_text("[driving]\nspeed = 1.2\n[rules]\narming = 'server'\n", encoding="utf-8")
        it.server.popen.send_signal(signal.SIGHUP)
        it.server.wait_for(r"INFO driving\.speed: 0\.4 -> 1\.2 m/s, in force")
        it.server.wait_for(r'WARNING rules\.arming: "auto" -> "server" needs a restart: still')
        submit(client, 54000, 4.0)
        wait_until(lambda: it.speed() > 1.0, within=30, what="the new speed")
        path.write_text("[driving]\nspeed = 0.5\nsped = 1\n", encoding="utf-8")
        it.server.popen.send_signal(signal.SIGHUP)
        it.server.wait_for(r"ERROR configuration: .*c\.toml:3: driving\.sped: no such key")
        it.server.wait_for("ERROR configuration: not applied")
        client.mav.param_set_send(1, 191, b"TSK_SPEED", 0.9, 9)
        it.server.wait_for("TSK_SPEED")
        shown = run("config", "show", "driving.speed", store=str(store))
        assert shown == (0, "driving.speed = 0.9  # m/s, TSK_SPEED, set by a client\n", ignored)
        it.server.end()
    assert it.server.popen.returncode == 0


def test_sighup_without_a_file_does_no_harm_at_whatever_time(tmp_path: Path) -> None:
    with process(*serving(tmp_path), folder=tmp_path, name="server") as server:
        wait_until(lambda: handles(server, signal.SIGHUP), within=20, what="the first handler")
        while "waiting for the first heartbeat" not in server.text:
            server.popen.send_signal(signal.SIGHUP)
            assert server.popen.poll() is None, server.text
        server.popen.send_signal(signal.SIGHUP)  # those before the first reading may mean nothing
        server.wait_for("configuration: reloaded, no changes")
        server.end()
    assert server.popen.returncode == 0


def handles(server: Process, number: int) -> bool:
    """Whether a process has said what it does on a signal."""
    status = Path(f"/proc/{server.popen.pid}/status").read_text(encoding="ascii")
    found = re.search(r"^SigCgt:\s*(\w+)", status, re.MULTILINE)
    return found is not None and bool(int(found[1], 16) >> (number - 1) & 1)


def test_a_server_whose_terminal_is_gone_ends_in_order(tmp_path: Path) -> None:
    """As it would in the foreground of a shell: nobody is there any more to see what it does."""
    ours, its = pty.openpty()
    log = tmp_path / "server.log"
    with log.open("wb") as sink:
        popen = subprocess.Popen(
            [sys.executable, *serving(tmp_path)],
            stdin=its,
            stdout=sink,
            stderr=subprocess.STDOUT,
            env=environment_with(),
            cwd=tmp_path,
        )
    os.close(its)
    server = Process(popen, log)
    try:
        server.wait_for("waiting for the first heartbeat")
        popen.send_signal(signal.SIGHUP)
        server.wait_for("configuration: reloaded")  # it is there: only the configuration is meant
        os.close(ours)
        popen.send_signal(signal.SIGHUP)
        assert popen.wait(10) == 0
    finally:
        popen.kill()
        popen.wait(10)


def test_the_sample_can_be_checked_and_what_is_in_force_too_in_a_pipe(tmp_path: Path) -> None:
    for command in (("config", "init"), ("config", "show")):
        code, printed, error = run(*command)
        assert (code, error) == (0, "")
        assert mav_tasks("config", "check", "-", given=printed) == Done(0, "ok\n", "")
