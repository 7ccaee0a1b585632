"""The web page beside the demonstration."""

import os
import re
import socket
import sys
import time
import webbrowser
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rover_sim.demo.processes import DemoError, process

USUAL = 8560  # port of the page
STARTS_WITHIN = 20.0  # s
LOOK = 0.2  # s between two looks at the processes

Check = Callable[[], None]


@contextmanager
def page(server: str, store: str, folder: Path) -> Iterator[tuple[str, Check]]:
    """Serve the web page; yield its address, and a check as ``process`` has it."""
    port = USUAL if is_free(USUAL) else 0  # another page may be there
    log = folder / "web.log"
    command = [sys.executable, "-m", "mav_tasks.cli", "web", "--server", server]
    command += ["--listen", f"127.0.0.1:{port}", "--store", store]
    keys = folder / "keys.toml"  # none: nobody needs a token, whatever keys the user has
    keys.touch(mode=0o600)
    command += ["--keys", str(keys)]
    with process(command, log) as check:
        yield _address(log, check), check


def is_free(port: int) -> bool:
    """Return whether nobody serves on a TCP port of the loopback."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def open_browser(url: str) -> None:
    """Show the page in the user's browser, if there is a screen."""
    has_screen = sys.platform == "darwin" or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )
    if has_screen:
        webbrowser.open(url)


def stay(checks: Iterable[Check]) -> None:
    """Return after Ctrl-C. Raise DemoError if a process ends before that."""
    every = tuple(checks)
    with suppress(KeyboardInterrupt):
        while True:
            for check in every:
                check()
            time.sleep(LOOK)


def _address(log: Path, check: Check) -> str:
    """Return the page's address, once the process has printed it."""
    end = time.monotonic() + STARTS_WITHIN
    while time.monotonic() < end:
        found = re.search(r"web page: (\S+)", log.read_text(encoding="utf-8", errors="replace"))
        if found is not None:
            return found[1]
        check()
        time.sleep(LOOK)
    raise DemoError(f"the web page did not start within {STARTS_WITHIN:g} s")
