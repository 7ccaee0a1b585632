"""``queue --watch``: a full-screen view on a terminal, else a new block at each change."""

import asyncio
import signal
from collections.abc import Callable
from contextlib import suppress

from rich.console import Group
from rich.live import Live
from rich.text import Text

from mav_tasks.basics.errors import NoAnswer
from mav_tasks.cli import output
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import is_alone, queues_of
from mav_tasks.cli.tables import queue_table
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import state_of
from mav_tasks.client.values import QueueStatus

PERIOD = 1.0  # s between two requests
OLD = 2.5  # s without an answer, after which the view says so


async def watch_queues(
    client: Client, common: Common, show: Callable[..., None], *, limit: int
) -> None:
    """Show queues until cancelled; keep trying if the server does not answer.

    ``show``: prints queues where there is no screen to draw on.
    """
    if common.json or not output.is_drawn_on():
        await _print_changes(client, common, show, limit=limit)
    else:
        await _draw(client, common, limit=limit)


async def _print_changes(
    client: Client, common: Common, show: Callable[..., None], *, limit: int
) -> None:
    told: list[object] = []
    while True:
        with suppress(NoAnswer):
            queues = await queues_of(client, common, limit=limit)
            if (seen := [_essence(queue) for queue in queues]) != told:
                told = seen
                show(queues, common, is_alone=is_alone(client, common))
        await asyncio.sleep(PERIOD)


async def _draw(client: Client, common: Common, *, limit: int) -> None:
    window, loop = Window(), asyncio.get_running_loop()
    with Live(
        console=output.console(), screen=True, auto_refresh=False, get_renderable=window.drawn
    ) as live:
        window.live = live
        loop.add_signal_handler(signal.SIGWINCH, live.refresh)
        refreshing = asyncio.create_task(_refresh(window))
        try:
            while True:
                with suppress(NoAnswer):
                    most = min(limit, live.console.height)
                    queues = await queues_of(client, common, limit=most)
                    window.take(queues, is_alone=is_alone(client, common))
                live.refresh()
                await asyncio.sleep(PERIOD)
        finally:
            refreshing.cancel()
            loop.remove_signal_handler(signal.SIGWINCH)


async def _refresh(window: "Window") -> None:
    """Redraw the age of the last answer while no new one arrives."""
    while True:
        await asyncio.sleep(PERIOD)
        if window.age > OLD and window.live is not None:
            window.live.refresh()


class Window:
    """The screen: the latest queues, cut to the present size of the terminal."""

    def __init__(self) -> None:
        self.live: Live | None = None
        self._queues: list[QueueStatus] = []
        self._is_alone = True
        self._loop = asyncio.get_running_loop()
        self._at = self._loop.time()

    @property
    def age(self) -> float:
        """Seconds since the last answer."""
        return self._loop.time() - self._at

    def take(self, queues: list[QueueStatus], *, is_alone: bool) -> None:
        """Store the latest queues; ``is_alone``: the server has one rover."""
        self._queues, self._is_alone = queues, is_alone
        self._at = self._loop.time()

    def drawn(self) -> Group:
        if self.live is None:
            return Group()
        width, height = self.live.console.size
        parts = [] if self.age <= OLD else [_line(f"no answer for {self.age:.0f} s")]
        rows = (height - len(parts)) // max(len(self._queues), 1)
        tables = [
            queue_table(queue, width=width, rows=rows, is_alone=self._is_alone)
            for queue in self._queues
        ]
        return Group(*parts, *tables)


def _line(text: str) -> Text:
    return Text(text, style="red", no_wrap=True, overflow="ellipsis")


def _essence(queue: QueueStatus) -> object:
    """Return what counts as a change: no times and no progress."""
    current = queue.current and (queue.current.id, state_of(queue.current))
    tasks = [(t.id, t.state, t.reason, t.priority, t.after) for t in queue.waiting]
    return current, queue.running, queue.paused, dict(queue.counts), tasks
