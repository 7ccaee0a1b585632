"""For the composition root: opens the socket early, and serves the metrics while the loop runs."""

import asyncio
import logging
from collections.abc import Callable, Sequence

from mav_tasks.engine.figures import Figures
from mav_tasks.engine.inputs import LinkSide
from mav_tasks.links.base import Link
from mav_tasks.links.endpoint import is_loopback
from mav_tasks.metrics import families as f
from mav_tasks.metrics.collector import Collector, Part
from mav_tasks.metrics.http_server import HttpServer, listening
from mav_tasks.metrics.pages import Pages
from mav_tasks.tasks.restored import Restored

log = logging.getLogger("mav_tasks")


class Endpoint:
    """The address at which scrapers read a collector's figures.

    ``listen`` is ``host:port``. The constructor opens it and raises UsageError if that fails.
    """

    def __init__(self, listen: str) -> None:
        self._listener = listening(listen, what="metrics")
        if not is_loopback(str(self._listener.getsockname()[0])):
            log.warning("metrics on %s: other machines can read them", listen)
        self._server = HttpServer(self._listener)

    def __repr__(self) -> str:
        return f"Endpoint({self._server!r})"

    def close(self) -> None:
        """Stop serving."""
        self._server.close()

    def show(
        self,
        figures: Figures,
        *,
        clients: Sequence[Link],
        vehicles: Sequence[Link],
        recorders: Sequence[object],
        restored: Restored | None,
        version: str,
        woke_at: Callable[[], float],
        loop: asyncio.AbstractEventLoop,
    ) -> Collector:
        """Return an observer whose figures are served from now on, made in the server's loop.

        ``Collector`` explains the other arguments.
        """
        collector = Collector(
            figures,
            links={LinkSide.CLIENTS: clients, LinkSide.VEHICLES: vehicles},
            recorders=recorders,
            restored=restored,
            version=version,
            woke_at=woke_at,
        )
        self._server.start(Pages(collector, loop=loop, answers=self._answers).by_path)
        return collector

    def _answers(self) -> Part:
        return {f.REQUESTS: [((int(code),), n) for code, n in self._server.answers.items()]}
