"""Real processes on loopback: the server, the simulated rover, and the rover's true poses."""

import csv
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from fcntl import LOCK_EX, LOCK_NB, flock
from functools import cache
from itertools import cycle, islice
from pathlib import Path
from tempfile import gettempdir
from typing import Any, TypeVar

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from tests.kit.forked import Popen, started

T = TypeVar("T")

START_LIMIT = 20.0  # s, for a process to report its start (cold caches, busy machine)
STOP_LIMIT = 30.0  # s
BUSY = 3.0
COPIED = 3.5  # s, within which the same request again is a copy
PORTS = range(20_000, 32_000)  # below Linux's ephemeral ports, above 14550 and its like
SHARES = 24  # test processes at a time, of all runs, each with its own ports
TOLD_OF_A_FAILURE = 8_000  # characters of each process's output


@dataclass
class Process:
    """A started process, and its output."""

    popen: Popen
    output: Path

    @property
    def text(self) -> str:
        """Its output so far."""
        return self.output.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, pattern: str, *, within: float = START_LIMIT) -> re.Match[str]:
        """Wait until the output matches; return the match."""
        return wait_until(
            lambda: re.search(pattern, self.text),
            within=within,
            what=lambda: f"{pattern!r} in:\n{self.text}",
        )

    def end(self, number: int = signal.SIGTERM) -> float:
        """Send a signal and wait for the end; return the seconds that it took."""
        began = time.monotonic()
        self.popen.send_signal(number)
        self.popen.wait(STOP_LIMIT)
        return time.monotonic() - began


def wait_until(
    condition: Callable[[], T | None], *, within: float, what: Callable[[], str] | str = "condition"
) -> T:
    """Poll a condition until it is true, and return it. Raise AssertionError with ``what``.

    On a machine that is busy with other programs it may take BUSY times as long.
    """
    end = time.monotonic() + BUSY * within
    while not (answer := condition()):
        if time.monotonic() > end:
            raise AssertionError(
                f"not in {BUSY * within:g} s: {what() if callable(what) else what}"
            )
        time.sleep(0.02)
    return answer


#: a machine that is busy with tests stands still for half a second now and then
OF_A_BUSY_MACHINE = {"MAV_TASKS_WATCH_LATE_TICK": "0.9", "MAV_TASKS_WATCH_COMMIT": "1.5"}


def environment_with(**variables: str) -> dict[str, str]:
    """Return our environment without the user's configuration, plus these variables."""
    return {**os.environ, "MAV_TASKS_CONFIG": "", **variables}


@contextmanager
def process(
    *arguments: str,
    folder: Path,
    name: str,
    python: str = sys.executable,
    env: dict[str, str] | None = None,
) -> Iterator[Process]:
    """Run a Python process for a ``with`` block; kill it if it is still running.

    Without a store option, a server's store is in ``folder``; it never uses the user's store,
    configuration or keys. ``env`` is another environment.
    """
    output = folder / f"{name}.log"
    env = env or environment_with(
        MAV_TASKS_STORE=str(folder / f"{name}.sqlite3"),
        XDG_CONFIG_HOME=str(folder),
        XDG_STATE_HOME=str(folder),
        **OF_A_BUSY_MACHINE,
    )
    popen = started(arguments, python=python, output=output, folder=folder, env=env)
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
    """A running server and rover."""

    server: Process
    rover: Process
    client_port: int
    rover_port: int
    push_port: int
    truth_file: Path
    _links: list[Any] = field(default_factory=list)

    def truth(self) -> list[dict[str, float]]:
        """Return the true poses so far, at 10 Hz, without an incomplete last line."""
        text = self.truth_file.read_text(encoding="ascii")
        rows = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
        return [{key: float(value) for key, value in row.items()} for row in rows]

    def speed(self) -> float:
        """Return the rover's true speed, m/s."""
        return abs(self.truth()[-1]["forward_speed"])

    def connect(self, *, source_system: int = 255) -> Any:
        """Return a stock pymavlink connection to the server; it has heard the rover."""
        return self.heard(f"udpout:127.0.0.1:{self.client_port}", source_system)

    def connect_to_rover(self) -> Any:
        """Return a stock pymavlink connection to the rover, bypassing the server."""
        return self.heard(f"udpout:127.0.0.1:{self.rover_port}", 254)

    def close(self) -> None:
        """Close every connection."""
        for link in self._links:
            link.close()

    def heard(self, url: str, source_system: int = 255, **options: Any) -> Any:
        """Return a stock pymavlink connection that has sent a heartbeat and heard the rover."""
        link = mavutil.mavlink_connection(url, source_system=source_system, **options)
        self._links.append(link)
        if url.startswith("udpout:"):
            # nothing else: another test's server may still send to a port whose client has left
            link.port.connect(link.destination_addr)
        link.mav.heartbeat_send(6, 8, 0, 0, 4)
        assert link.wait_heartbeat(timeout=10) is not None, "no heartbeat"
        wait_for(link, "LOCAL_POSITION_NED")
        wait_for(link, "ATTITUDE")
        return link

    def heard_by(self, url: str, source_system: int = 255) -> Any:
        """Return a connection to which the server speaks first; only then can it be answered."""
        link = mavutil.mavlink_connection(url, source_system=source_system)
        self._links.append(link)
        wait_for(link, "HEARTBEAT")
        link.mav.heartbeat_send(6, 8, 0, 0, 4)
        wait_for(link, "LOCAL_POSITION_NED")
        return link

    def drive(self, link: Any, distance: float) -> int:
        """Submit a move and wait until the rover is at speed; return the task's id."""
        task_id = submit(link, 54000, distance)
        wait_until(lambda: self.speed() > 0.3, within=15, what="the rover at speed")
        return task_id


def udp_to(rover_port: int) -> AbstractContextManager[str]:
    """Return the rover's plain UDP URL."""
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
    """Run a server and a rover of a persona on their own ports.

    ``module`` runs the server, with its arguments before ``serve``. ``way`` turns the rover's UDP
    port into the server's URL for it. ``client_options`` follow the URL for clients.
    """
    client_port, rover_port, push_port = free_udp_ports(3)
    truth = folder / "truth.csv"
    rover = ["-m", "rover_sim", "--port", str(rover_port), "--body", body, "--persona", persona]
    # ready at once; tests talk to the rover beside the server
    rover += ["--boot", "none", "--peers", "all", "--truth", str(truth), *rover_options]
    serve = ["-m", *module, "serve"]
    serve += ["--client", f"udpin:127.0.0.1:{client_port}{client_options}"]
    serve += ["--push", f"127.0.0.1:{push_port}"]
    # a PX4 rover drives home when setpoints stop; tests of that set their own option
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
    """Send a COMMAND_LONG and wait for its acceptance; return result_param2, the task's id."""
    ack = command_long(link, command, *params, target=target)
    assert ack.result == 0, ack
    return int(ack.result_param2)


def command_long(
    link: Any, command: int, *params: float, target: tuple[int, int] = (1, 191)
) -> Any:
    """Send a COMMAND_LONG and return its COMMAND_ACK."""
    filled = (*params, *(0.0,) * (7 - len(params)))
    while link.recv_match() is not None:
        pass  # a buffer that is full of telemetry would have no room for the ack
    link.mav.command_long_send(*target, command, 0, *filled)
    return wait_for(link, "COMMAND_ACK", f"COMMAND_ACK.command=={command}", within=5)


def after_a_restart() -> None:
    """Wait until a restarted server no longer treats a request as a copy of an older one."""
    time.sleep(COPIED + 0.5)


def free_tcp_ports(count: int) -> list[int]:
    """Return free TCP ports of the loopback."""
    return _free_ports(count, socket.SOCK_STREAM)


def free_udp_ports(count: int) -> list[int]:
    """Return free UDP ports of the loopback."""
    return _free_ports(count, socket.SOCK_DGRAM)


def _free_ports(count: int, kind: socket.SocketKind) -> list[int]:
    ports = _ports_of_this_process()
    return list(islice((port for port in ports if _is_free(port, kind)), count))


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


@cache
def _ports_of_this_process() -> Iterator[int]:
    """Return ports that no other test process of this user gets, each again after all others.

    They lie below the system's ephemeral ports: a server keeps sending to a client that has just
    left, and pushes to ports where nobody may listen. The next user of such a port would receive
    that, and take another test's rover for its own.
    """
    for number in range(SHARES):
        name = f"mav-tasks-ports-{os.getuid()}-{number}"
        lock = os.open(Path(gettempdir(), name), os.O_RDONLY | os.O_CREAT, 0o644)
        with suppress(BlockingIOError):
            flock(lock, LOCK_EX | LOCK_NB)  # until this process ends
            own = PORTS[number::SHARES]
            begin = os.getpid() * 97 % len(own)  # who has them next starts elsewhere
            return cycle((*own[begin:], *own[:begin]))
        os.close(lock)
    raise RuntimeError(f"{SHARES} test processes are at work already")


def wait_for(
    link: Any, kind: str | list[str], condition: str | None = None, *, within: float = 10
) -> Any:
    """Wait for a message of a type; return it."""
    limit = BUSY * within
    message = link.recv_match(type=kind, condition=condition, blocking=True, timeout=limit)
    assert message is not None, f"no {kind} ({condition}) in {limit:g} s"
    return message


@contextmanager
def frozen(process: Process) -> Iterator[None]:
    """Stop a process (SIGSTOP) for a ``with`` block."""
    process.popen.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.popen.send_signal(signal.SIGCONT)
