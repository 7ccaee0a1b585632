"""Processes of a measurement: started, watched in /proc, ended by their own id.

A server is ``mav-tasks serve`` of any revision: ``tree`` is the folder of its files. No process
sees the user's configuration, keys or store.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from time import clock_gettime

from rover_sim.postgres import installed
from tests.kit import processes
from tests.kit.postgres import PostgresServer
from tests.kit.processes import free_udp_ports

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / "build"  # on the project's disk
HOST = "127.0.0.1"
CLI = ("-P", "-m", "mav_tasks.cli")
TIMED_CLI = ("-P", str(Path(__file__).with_name("timed_serve.py")))
#: as many commands as a measurement has, at any rate
UNLIMITED = [
    f"--set={setting}"
    for setting in (
        *("queueing.capacity=100000", "queueing.quota=100000", "clients.packet_rate=1000000"),
        *("clients.stream_interval=0", "roles.safety.quota=1000000", "roles.safety.rate=100000"),
    )
]


@dataclass
class Process(processes.Process):
    """A process in a folder of its own; ``port`` is a server's, for clients."""

    port: int = 0
    said: str = ""  # at its end

    def seconds(self) -> float:
        """Return the processor time that it has used."""
        return cpu_seconds(self.popen.pid)

    def memory(self) -> int:
        """Return its resident memory, in bytes."""
        pages = Path(f"/proc/{self.popen.pid}/statm").read_text(encoding="ascii").split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    def size(self, pattern: str) -> int:
        """Return the size of files in its folder, in bytes."""
        return sum(each.stat().st_size for each in self.output.parent.glob(pattern))


def environment(tree: Path) -> dict[str, str]:
    """Return an environment with the modules of a tree, whose bytecode is kept, as installed."""
    modules = {"PYTHONPATH": f"{tree}:{tree / 'sim'}", "PYTHONHASHSEED": "0"}
    ours = {"MAV_TASKS_CONFIG": "", "MAV_TASKS_LINKS_PUSH": "", "MAV_TASKS_STORE": ":memory:"}
    return {**os.environ, **modules, **ours, "PYTHONDONTWRITEBYTECODE": ""}


@contextmanager
def process(*arguments: str, tree: Path = ROOT) -> Iterator[Process]:
    """Run Python for a ``with`` block, with the modules of a tree."""
    with TemporaryDirectory(dir=BUILD) as name:
        homes = {f"XDG_{kind}_HOME": name for kind in ("CONFIG", "DATA", "STATE")}
        env = {**environment(tree), **homes}
        with processes.process(*arguments, folder=Path(name), name="its", env=env) as started:
            it = Process(started.popen, started.output)
            try:
                yield it
            finally:
                it.end()
                it.said = it.text


@contextmanager
def beside(do: Callable[..., object], *arguments: object) -> Iterator[None]:
    """Call a function in a process of its own for a ``with`` block, then kill it."""
    it = get_context("fork").Process(target=do, args=arguments)
    it.start()
    try:
        yield
    finally:
        it.kill()
        it.join()


@contextmanager
def bare(*to: int) -> Iterator[Process]:
    """Run the yardstick for a ``with`` block: an echo, or a forwarder to a port."""
    with process(str(Path(__file__).with_name("bare.py")), *map(str, to)) as it:
        it.port = int(it.wait_for(r"at (\d+)\n")[1])
        yield it


@contextmanager
def server(
    tree: Path, rover: int, *options: str, is_timed: bool = False, is_limited: bool = False
) -> Iterator[Process]:
    """Run a server for a ``with`` block, for a client's port and a rover's.

    With ``is_timed``, its last line is triples as JSON: a rover's system id, when a moving setpoint
    to it left, and the seconds since the one before.
    """
    (port,) = free_udp_ports(1)
    links = f"--client=udpin:{HOST}:{port}", f"--vehicle=udpout:{HOST}:{rover}"
    limits = [] if is_limited else UNLIMITED
    cli = TIMED_CLI if is_timed else CLI
    with process(*cli, "serve", *links, *limits, *options, tree=tree) as it:
        it.port = port
        yield it


@contextmanager
def simulated_rovers(count: int, *, first: int = 1) -> Iterator[int]:
    """Run kinematic rovers for a ``with`` block; yield their UDP port."""
    (port,) = free_udp_ports(1)
    numbers = f"--count={count}", f"--system-id={first}", f"--port={port}"
    with process("-m", "rover_sim", "--body=kinematic", "--boot=none", *numbers):
        yield port


@contextmanager
def database() -> Iterator[PostgresServer]:
    """Run a database server for a ``with`` block, as durable as a user's."""
    with closing(PostgresServer(installed())) as made:
        made.start()
        yield made


def cpu_seconds(*pids: int) -> float:
    """Return the processor time that processes have used."""
    return sum(clock_gettime(~pid << 3 | 2) for pid in pids)  # clock_getcpuclockid(3) of Linux
