"""Child processes of a measurement: started, waited for, ended by their own id."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
#: environment variable: folder of the measured server, for another revision (``against``)
SERVER_FROM = "MAV_TASKS_BENCH_SERVER_FROM"
HOST = "127.0.0.1"
READY = "ready"  # a child prints it once its sockets are open
END_WITHIN = 10.0  # s


class Said(list[str]):
    """The lines that a child printed at its end; ``pid``: its process."""

    pid = 0


@contextmanager
def child(
    module: str, *arguments: str, quiet: bool = False, pass_fds: tuple[int, ...] = ()
) -> Iterator[Said]:
    """Run a module of this package as a process for a ``with`` block.

    A server runs from the folder in SERVER_FROM, if set. ``quiet`` discards stderr, where the log
    goes. After the block, the list has the lines that the process printed at its end.
    """
    said = Said()
    process = subprocess.Popen(
        [sys.executable, "-m", f"tools.bench.{module}", *arguments],
        cwd=os.environ.get(SERVER_FROM, ROOT) if module == "server" else ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL if quiet else None,
        text=True,
        pass_fds=pass_fds,
    )
    try:
        assert process.stdout is not None
        if process.stdout.readline().strip() != READY:
            raise RuntimeError(f"{module} did not start")
        said.pid = process.pid
        yield said
    finally:
        process.terminate()
        said += process.communicate(timeout=END_WITHIN)[0].splitlines()


@contextmanager
def simulated_rovers(count: int, port: int) -> Iterator[None]:
    """Run kinematic rovers on a UDP port for a ``with`` block."""
    command = [sys.executable, "-m", "rover_sim", "--body", "kinematic", "--boot", "none"]
    command += ["--count", str(count), "--port", str(port)]
    simulator = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        simulator.terminate()
        simulator.wait(END_WITHIN)


def free_port() -> int:
    """Return a free UDP port of the loopback interface."""
    with udp_socket() as probe:
        port: int = probe.getsockname()[1]
        return port


def udp_socket(port: int = 0) -> socket.socket:
    """Return a bound loopback UDP socket with a time-out of one second."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    sock.bind((HOST, port))
    sock.settimeout(1.0)
    return sock
