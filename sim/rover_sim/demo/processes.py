"""The processes of the demonstration: started, watched, and ended."""

import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

STOP_LIMIT = 5.0  # s, for a process to end after SIGTERM
#: how a process ends after Ctrl-C, which a terminal sends to all of them
INTERRUPTED = (130, -signal.SIGINT)
#: and if SIGTERM comes while it is already ending after Ctrl-C
ENDED = (0, *INTERRUPTED, -signal.SIGTERM)


class DemoError(Exception):
    """The demonstration could not be run; the message has the reason."""


@contextmanager
def process(command: list[str], log: Path) -> Iterator[Callable[[], None]]:
    """Run a process for a ``with`` block; then end it with SIGTERM and check its exit status.

    The value is a check that raises DemoError, with the process's last line, if it has ended.
    """
    with log.open("wb") as output:
        running = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)

    def check() -> None:
        code = running.poll()
        if code is not None and code not in INTERRUPTED:
            name = " ".join(command[1:3])
            raise DemoError(f"{name} ended early, exit code {code}: {_last_line(log)}")

    try:
        yield check
        if running.poll() not in (0, *INTERRUPTED):
            check()
    finally:
        if running.poll() is None:
            running.send_signal(signal.SIGTERM)
            try:
                running.wait(STOP_LIMIT)
            except subprocess.TimeoutExpired:
                running.kill()
                running.wait()
    if running.returncode not in ENDED:
        raise DemoError(f"{' '.join(command[1:3])} ended with {running.returncode}")


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
