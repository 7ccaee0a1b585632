"""Real processes on loopback: the server, the simulated rover, and where the rover truly is."""

import csv
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from itertools import cycle, islice
from pathlib import Path
from typing import Any, TypeVar

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from mav_tasks.services.command_receiver import COPIED

T = TypeVar("T")

START_LIMIT = 20.0  # s, for a process to say that it is there (cold caches, busy machine)
STOP_LIMIT = 10.0  # s
PORTS = range(20_000, 32_000)  # below those that Linux gives by itself, above 14550 and its like
WORKERS = 8  # of pytest-xdist, each with ports of its own
TOLD_OF_A_FAILURE = 8_000  # characters of what each process had said


@dataclass
class Process:
    """A process that we started, and what it says."""

    popen: subprocess.Popen[bytes]
    output: Path

    @property
    def text(self) -> str:
        """Return all that it has written so far."""
        return self.output.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, pattern: str, *, within: float = START_LIMIT) -> re.Match[str]:
        """Wait until it writes something that matches."""
        return wait_until(
            lambda: re.search(pattern, self.text),
            within=within,
            what=lambda: f"{pattern!r} in:\n{self.text}",
        )

    def end(self, number: int = signal.SIGTERM) -> float:
        """Send a signal and wait for the end; gives the seconds that it took."""
        began = time.monotonic()
        self.popen.send_signal(number)
        self.popen.wait(STOP_LIMIT)
        return time.monotonic() - began


def wait_until(
    condition: Callable[[], T | None], *, within: float, what: Callable[[], str] | str = "condition"
) -> T:
    """Ask until the answer is true; AssertionError names what did not come in time."""
    end = time.monotonic() + within
    while not (answer := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"not in {within} s: {what() if callable(what) else what}")
        time.sleep(0.02)
    return answer


def environment_with(**variables: str) -> dict[str, str]:
    """Return our environment without its user's configuration, and with these variables."""
    return {**os.environ, "MAV_TASKS_CONFIG": "", **variables}


@contextmanager
def process(
    *arguments: str, folder: Path, name: str, python: str = sys.executable
) -> Iterator[Process]:
    """Run a Python process while the block runs; it is killed if it is still there after it.

    A server in it that is told no store has one in ``folder``: never its user's own, and none of
    its user's configuration and keys.
    """
    output = folder / f"{name}.log"
    with output.open("wb") as sink:
        popen = subprocess.Popen(
            [python, *arguments],
            stdout=sink,
            stderr=subprocess.STDOUT,
            cwd=folder,
            env=environment_with(
                MAV_TASKS_STORE=str(folder / f"{name}.sqlite3"),
                XDG_CONFIG_HOME=str(folder),
                XDG_STATE_HOME=str(folder),
            ),
        )
    running = Process(popen, output)
    try:
        yield running
    except BaseException:
        print(f"--- {name} had said, at its end:\n{running.text[-TOLD_OF_A_FAILURE:]}")
        raise
    finally:
        if popen.poll() is None:
            popen.kill()
        popen.wait(STOP_LIMIT)


@dataclass
class Stand:
    """A server and a rover, running."""

    server: Process
    rover: Process
    client_port: int
    rover_port: int
    push_port: int
    truth_file: Path
    _links: list[Any] = field(default_factory=list)

    def truth(self) -> list[dict[str, float]]:
        """Return the true poses so far, ten a second; a last half line is left out."""
        text = self.truth_file.read_text(encoding="ascii")
        rows = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
        return [{key: float(value) for key, value in row.items()} for row in rows]

    def speed(self) -> float:
        """Return the rover's true speed, m/s."""
        return abs(self.truth()[-1]["forward_speed"])

    def connect(self, *, source_system: int = 255) -> Any:
        """Return a stock pymavlink connection to the server that has heard the rover."""
        return self.heard(f"udpout:127.0.0.1:{self.client_port}", source_system)

    def connect_to_rover(self) -> Any:
        """Give one to the rover itself, past the server."""
        return self.heard(f"udpout:127.0.0.1:{self.rover_port}", 254)

    def close(self) -> None:
        """Close every connection given."""
        for link in self._links:
            link.close()

    def heard(self, url: str, source_system: int = 255, **options: Any) -> Any:
        """Return a stock pymavlink connection that has said hello and heard the rover."""
        link = mavutil.mavlink_connection(url, source_system=source_system, **options)
        self._links.append(link)
        link.mav.heartbeat_send(6, 8, 0, 0, 4)
        assert link.wait_heartbeat(timeout=10) is not None, "no heartbeat"
        wait_for(link, "LOCAL_POSITION_NED")
        wait_for(link, "ATTITUDE")
        return link

    def heard_by(self, url: str, source_system: int = 255) -> Any:
        """Give one to which the server comes: who is there can be spoken to only then."""
        link = mavutil.mavlink_connection(url, source_system=source_system)
        self._links.append(link)
        wait_for(link, "HEARTBEAT")
        link.mav.heartbeat_send(6, 8, 0, 0, 4)
        wait_for(link, "LOCAL_POSITION_NED")
        return link

    def drive(self, link: Any, distance: float) -> int:
        """Submit a move, wait until the rover is at speed; gives the task's id."""
        task_id = submit(link, 54000, distance)
        wait_until(lambda: self.speed() > 0.3, within=15, what="the rover at speed")
        return task_id


def udp_to(rover_port: int) -> AbstractContextManager[str]:
    """Return the way to a rover past which there is nothing."""
    return nullcontext(f"udpout:127.0.0.1:{rover_port}")


@contextmanager
def stand(
    folder: Path,
    *serve_options: str,
    body: str = "kinematic",
    persona: str = "ardupilot",
    serve_store: str = ":memory:",
    client_options: str = "",
    rover_options: tuple[str, ...] = (),
    module: tuple[str, ...] = ("mav_tasks.cli",),
    way: Callable[[int], AbstractContextManager[str]] = udp_to,
) -> Iterator[Stand]:
    """Run a server and a rover of that make on ports of their own.

    ``module`` is what runs the server, with its arguments before ``serve``. ``way`` makes of the
    rover's UDP port the URL by which the server is to reach it, ``client_options`` stand behind the
    URL for clients.
    """
    client_port, rover_port, push_port = free_udp_ports(3)
    truth = folder / "truth.csv"
    rover = ["-m", "rover_sim", "--port", str(rover_port), "--body", body, "--persona", persona]
    # The scenarios on processes were written for exact arithmetic; px4 then has many peers.
    rover += ["--noise", "off", "--truth", str(truth), *rover_options]
    serve = ["-m", *module, "serve"]
    serve += ["--client", f"udpin:127.0.0.1:{client_port}{client_options}"]
    serve += ["--push", f"127.0.0.1:{push_port}"]
    # a PX4 rover drives home by itself when setpoints stop: tests that are about that say so
    if not any("loss_failsafe" in option for option in serve_options):
        serve += ["--set", "rules.loss_failsafe=accept"]
    serve += ["--store", serve_store, *serve_options]
    with (
        process(*rover, folder=folder, name="rover") as rover_process,
        way(rover_port) as url,
        process(*serve, "--vehicle", url, folder=folder, name="server") as server_process,
    ):
        server_process.wait_for("rover 1: found")
        wait_until(truth.exists, within=START_LIMIT, what="the truth file")
        it = Stand(server_process, rover_process, client_port, rover_port, push_port, truth)
        try:
            yield it
        finally:
            it.close()


def submit(link: Any, command: int, *params: float, target: tuple[int, int] = (1, 191)) -> int:
    """Send a COMMAND_LONG, wait for its acceptance; gives result_param2, the task's id."""
    ack = command_long(link, command, *params, target=target)
    assert ack.result == 0, ack
    return int(ack.result_param2)


def command_long(
    link: Any, command: int, *params: float, target: tuple[int, int] = (1, 191)
) -> Any:
    """Send a COMMAND_LONG and give its COMMAND_ACK."""
    filled = (*params, *(0.0,) * (7 - len(params)))
    link.mav.command_long_send(*target, command, 0, *filled)
    ack = link.recv_match(
        type="COMMAND_ACK", condition=f"COMMAND_ACK.command=={command}", blocking=True, timeout=5
    )
    assert ack is not None, f"no ack for {command}"
    return ack


def after_a_restart() -> None:
    """Wait until the server, just started again, takes no word for a copy of an older one."""
    time.sleep(COPIED + 0.5)


def free_tcp_ports(count: int) -> list[int]:
    """Return TCP ports of the loopback that nobody uses at this moment."""
    return _free_ports(count, socket.SOCK_STREAM)


def free_udp_ports(count: int) -> list[int]:
    """Return UDP ports of the loopback that nobody uses at this moment."""
    return _free_ports(count, socket.SOCK_DGRAM)


def _free_ports(count: int, kind: socket.SocketKind) -> list[int]:
    return list(islice((port for port in _own_ports if _is_free(port, kind)), count))


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def _ports_of_this_process() -> Iterator[int]:
    """Return ports that no other process of this run is given, none again before all have been.

    They lie below those that the system gives by itself: a server goes on sending to who has just
    left, and pushes to where nobody may listen. What comes next to such a port would hear it, and
    take a stranger's rover for its own.
    """
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    own = PORTS[worker % WORKERS :: WORKERS]
    begin = os.getpid() * 97 % len(own)  # two runs beside each other begin at different ones
    return cycle((*own[begin:], *own[:begin]))


_own_ports = _ports_of_this_process()


def wait_for(
    link: Any, kind: str | list[str], condition: str | None = None, *, within: float = 10
) -> Any:
    """Wait for a message of a kind."""
    message = link.recv_match(type=kind, condition=condition, blocking=True, timeout=within)
    assert message is not None, f"no {kind} ({condition}) in {within} s"
    return message


@contextmanager
def frozen(process: Process) -> Iterator[None]:
    """Have a process do nothing for a while."""
    process.popen.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.popen.send_signal(signal.SIGCONT)
