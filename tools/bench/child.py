"""Processes that a measurement talks to: started, waited for, ended by their own id."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
#: names a folder whose server is measured in place of this one: another revision's (``against``)
SERVER_FROM = "MAV_TASKS_BENCH_SERVER_FROM"
HOST = "127.0.0.1"
READY = "ready"  # what a child prints once its sockets are open
END_WITHIN = 10.0  # s


@contextmanager
def child(
    module: str, *arguments: str, quiet: bool = False, pass_fds: tuple[int, ...] = ()
) -> Iterator[list[str]]:
    """Run a module of this package as a process of its own while the block runs.

    A server is that of the folder that SERVER_FROM names, if it names one. What a ``quiet`` one
    writes to stderr, its log, is thrown away by the system. The list that it gives holds, after the
    block, the lines that the process printed in the end.
    """
    said: list[str] = []
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
        yield said
    finally:
        process.terminate()
        said += process.communicate(timeout=END_WITHIN)[0].splitlines()


@contextmanager
def simulated_rovers(count: int, port: int) -> Iterator[None]:
    """Run kinematic rovers on a UDP port while the block runs."""
    command = [sys.executable, "-m", "rover_sim", "--body", "kinematic", "--noise", "off"]
    command += ["--count", str(count), "--port", str(port)]
    simulator = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        simulator.terminate()
        simulator.wait(END_WITHIN)


def free_port() -> int:
    """Return a UDP port of the loopback interface that nobody has at the moment."""
    with udp_socket() as probe:
        port: int = probe.getsockname()[1]
        return port


def udp_socket(port: int = 0) -> socket.socket:
    """Return a bound loopback UDP socket that waits at most a second."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    sock.bind((HOST, port))
    sock.settimeout(1.0)
    return sock
