"""For the composition root: opens the socket early, and serves the metrics while the loop runs."""

import asyncio
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from mav_tasks.links.endpoint import is_loopback
from mav_tasks.metrics import families as f
from mav_tasks.metrics.collector import Collector
from mav_tasks.metrics.http_server import HttpServer, listen
from mav_tasks.metrics.pages import Pages
from mav_tasks.settings import Metrics

log = logging.getLogger("mav_tasks")


def opened(metrics: Metrics) -> socket.socket | None:
    """Return a socket that listens for scrapers, None if metrics are off. Raise UsageError."""
    if not metrics.listen:
        return None
    listener = listen(metrics.listen, what="metrics.listen")
    if not is_loopback(str(listener.getsockname()[0])):
        words = "metrics on %s: every machine that reaches this address can read them"
        log.warning(words, metrics.listen)
    return listener


@contextmanager
def served(listener: socket.socket, collector: Collector) -> Iterator[None]:
    """Show the figures of a collector for a ``with`` block, in its running event loop."""
    server = HttpServer(listener)
    pages = Pages(
        collector,
        loop=asyncio.get_running_loop(),
        answers=lambda: {f.REQUESTS: [((int(code),), n) for code, n in server.answers.items()]},
    )
    server.start(pages.by_path)
    try:
        yield
    finally:
        server.close()
