"""The web page beside a server: ``serve --web`` starts and ends it as a process of its own.

So nothing that a browser does can delay a setpoint. The page ends when its standard input does,
which the server's process holds: also if that is killed.
"""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from mav_tasks.basics.errors import UsageError
from mav_tasks.config.settings import ServerSettings
from mav_tasks.links.config_check import links_of
from mav_tasks.links.endpoint import HostUrl
from mav_tasks.store.opening import IN_MEMORY
from mav_tasks.store.sqlite import path_of

DIALS = {"udpin": "udpout", "tcpin": "tcp"}  # by the kind of the server's link
EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}
ENDS_WITHIN = 5.0  # s


@contextmanager
def page_beside(listen: str, settings: ServerSettings) -> Iterator[None]:
    """Serve the page as long as the block runs. Raise UsageError if it cannot reach the server."""
    place = settings.store
    store = "" if place == IN_MEMORY else place if "://" in place else str(path_of(place))
    command = [sys.executable, "-m", "mav_tasks.cli", "web", "--beside-server", "--listen", listen]
    command += ["--server", _server_of(settings), "--store", store]
    command += ["--keys", settings.links.keys] if settings.links.keys else []
    # a session of its own: Ctrl-C is for the server, which stops its rovers first
    page = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
    try:
        yield
    finally:
        assert page.stdin is not None
        page.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            page.wait(ENDS_WITHIN)
        page.kill()
        page.wait()


def end_with_input() -> None:
    """End this process in order when its standard input ends."""

    def wait() -> None:
        sys.stdin.buffer.read()
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True).start()


def _server_of(settings: ServerSettings) -> str:
    for link in links_of(settings.links):
        url = link.url
        if link.side == "clients" and isinstance(url, HostUrl) and url.kind in DIALS:
            host = EVERYWHERE.get(url.host, url.host)
            return f"{DIALS[url.kind]}:{host}:{url.port}"
    raise UsageError("--web needs a link for clients that listens: --client udpin:127.0.0.1:14560")
