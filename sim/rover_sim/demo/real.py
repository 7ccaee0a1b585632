"""The demonstration in real time: server and rover are separate processes, connected by UDP."""

import csv
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ["MAVLINK20"] = "1"  # pymavlink's switch, read when it is imported

from pymavlink import mavutil

from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import Place, ThirdParty

TIME_LIMIT = 85.0  # s, for everything
STOP_LIMIT = 5.0  # s, for a process to end after SIGTERM
REFRESH = 0.2  # s


class DemoError(Exception):
    """The demonstration could not be run; the message has the reason."""


def drive(
    screen: Screen, *, body: str, noise: str, gui: bool, seed: int, record: str
) -> tuple[ThirdParty, list[Place]]:
    """Run server, rover and third party; return the third party and the true track."""
    with tempfile.TemporaryDirectory(prefix="mav-tasks-demo-") as folder:
        truth_file = Path(folder) / "truth.csv"
        rover_port, client_port = free_ports(2)
        rover = [sys.executable, "-m", "rover_sim", "--port", str(rover_port), "--body", body]
        rover += ["--truth", str(truth_file), "--noise", noise]
        rover += ["--seed", str(seed), "--friction-variation", "0.3"] if seed else []
        rover += ["--gui"] if gui else []
        server = [sys.executable, "-m", "mav_tasks.cli", "serve", "--config", ""]
        server += ["--client", f"udpin:127.0.0.1:{client_port}"]
        server += ["--vehicle", f"udpout:127.0.0.1:{rover_port}", "--store", ":memory:"]
        server += ["--record", record] if record else []
        with (
            process(rover, Path(folder) / "rover.log") as check_rover,
            process(server, Path(folder) / "server.log") as check_server,
        ):
            screen.say(f"rover: {body} body on UDP {rover_port}; server on UDP {client_port}")
            screen.say("a QGroundControl on this machine will see the rover")
            party = _watch(screen, client_port, truth_file, (check_rover, check_server))
        return party, read_track(truth_file)


def _watch(
    screen: Screen, port: int, truth_file: Path, checks: tuple[Callable[[], None], ...]
) -> ThirdParty:
    link = mavutil.mavlink_connection(f"udpout:127.0.0.1:{port}", source_system=255)
    try:
        party = ThirdParty(link.mav, lambda: read_track(truth_file)[-1], screen.say)
        end = time.monotonic() + TIME_LIMIT
        next_refresh = 0.0
        while not party.is_over:
            now = time.monotonic()
            if now > end:
                screen.say(f"gave up after {TIME_LIMIT:.0f} s")
                break
            party.step(now)
            message = link.recv_match(blocking=True, timeout=0.1)
            if message is not None:
                party.take(message)
            if now >= next_refresh:
                next_refresh = now + REFRESH
                screen.update(party)
                for check in checks:
                    check()
        screen.update(party)
        return party
    finally:
        link.close()


@contextmanager
def process(command: list[str], log: Path) -> Iterator[Callable[[], None]]:
    """Run a process for a ``with`` block; then end it with SIGTERM and check its exit status.

    The value is a check that raises DemoError, with the process's last line, if it has ended.
    """
    with log.open("wb") as output:
        running = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)

    def check() -> None:
        if running.poll() is not None:
            name, code = " ".join(command[1:3]), running.returncode
            raise DemoError(f"{name} ended early, exit code {code}: {_last_line(log)}")

    try:
        yield check
        check()
    finally:
        if running.poll() is None:
            running.send_signal(signal.SIGTERM)
            try:
                running.wait(STOP_LIMIT)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()
    if running.returncode != 0:
        raise DemoError(f"{' '.join(command[1:3])} ended with {running.returncode}")


def read_track(truth_file: Path) -> list[Place]:
    """Return the true poses that the rover has written so far, without an incomplete last line."""
    text = truth_file.read_text(encoding="ascii") if truth_file.exists() else ""
    rows = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
    return [Place(float(r["north"]), float(r["east"]), float(r["yaw"])) for r in rows]


def free_ports(count: int) -> list[int]:
    """Return free UDP ports of the loopback."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return [int(each.getsockname()[1]) for each in sockets]
    finally:
        for each in sockets:
            each.close()


def _last_line(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return lines[-1] if lines else "no output"
