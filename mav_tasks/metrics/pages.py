"""The pages of the server's metrics, for the thread of the HTTP server.

Each page asks the event loop, in small callbacks, and waits for a bounded time: if the loop does
not turn, the answer says so.
"""

import asyncio
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from enum import Enum
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from itertools import chain
from typing import TypeVar

from mav_tasks.metrics import families as f
from mav_tasks.metrics import process
from mav_tasks.metrics.collector import Collector, Part, Raw
from mav_tasks.metrics.exposition import CONTENT_TYPE, Sample, lines_of
from mav_tasks.metrics.http_server import Answer, Page

T = TypeVar("T")

LOOP_WITHIN = 1.0  # s, for the event loop to answer
FRESH = 1.0  # s, for which a text is given again: more scrapers cost the loop nothing
VEHICLES_AT_ONCE = 8  # in one callback of the loop, some 0.2 ms
LINES_AT_ONCE = 25  # between two pauses, some 0.05 ms
PAUSE = 50e-6  # s, in which the loop can get the interpreter's lock (GIL)
DASHBOARD = "grafana.json"


class LoopIsSilent(Exception):
    """The event loop did not answer in time."""


class Pages:
    """Makes the pages. Created in the event loop's thread; ``by_path`` are for another one."""

    def __init__(
        self, collector: Collector, *, loop: asyncio.AbstractEventLoop, answers: Callable[[], Part]
    ) -> None:
        """``answers`` returns the answers of the HTTP server itself."""
        self._collector = collector
        self._loop = loop
        self._answers = answers
        self._making: asyncio.Task[bytes] | None = None
        self._made_at = 0.0

    def __repr__(self) -> str:
        return f"Pages({self._collector!r})"

    @property
    def by_path(self) -> dict[str, Page]:
        return {
            "/metrics": self._metrics,
            "/healthz": self._healthz,
            "/readyz": self._readyz,
            f"/{DASHBOARD}": self._dashboard,
        }

    async def _metrics(self) -> Answer:
        if self._collector.is_broken:
            return Answer(HTTPStatus.INTERNAL_SERVER_ERROR, b"nothing is counted: see the log\n")
        making = self._making
        if making is None or (making.done() and time.monotonic() - self._made_at > FRESH):
            making = self._making = asyncio.create_task(self._text())
            making.add_done_callback(_note_failure)
        try:
            return Answer(HTTPStatus.OK, await asyncio.shield(making), CONTENT_TYPE)
        except LoopIsSilent as silence:
            return _unavailable(str(silence))

    async def _healthz(self) -> Answer:
        try:
            await self._ask(lambda: None)
        except LoopIsSilent as silence:
            return _unavailable(str(silence))
        return Answer(HTTPStatus.OK, b"ok\n")

    async def _readyz(self) -> Answer:
        try:
            why_not = await self._ask(self._collector.why_not_ready)
        except LoopIsSilent as silence:
            return _unavailable(str(silence))
        return _unavailable(why_not) if why_not else Answer(HTTPStatus.OK, b"ok\n")

    async def _dashboard(self) -> Answer:
        return Answer(HTTPStatus.OK, dashboard(), "application/json")

    async def _text(self) -> bytes:
        try:
            return await self._fresh_text()
        finally:
            self._made_at = time.monotonic()

    async def _fresh_text(self) -> bytes:
        totals, vehicles = await self._ask(self._collector.totals)
        parts = [totals]
        for first in range(0, len(vehicles), VEHICLES_AT_ONCE):
            some = vehicles[first : first + VEHICLES_AT_ONCE]
            parts.append(await self._ask(partial(self._collector.vehicles, some)))
        lines: list[str] = []
        for line in self._lines([*parts, self._answers()]):
            lines.append(line)
            if len(lines) % LINES_AT_ONCE == 0:
                await asyncio.sleep(PAUSE)
        return "".join(f"{line}\n" for line in lines).encode()

    def _lines(self, parts: list[Part]) -> Iterator[str]:
        own = dict(process.figures())
        for family in f.FAMILIES:
            raw = chain.from_iterable(part.get(family, ()) for part in parts)
            yield from lines_of(family, chain(_labelled(raw), own.get(family, ())))

    async def _ask(self, what: Callable[[], T]) -> T:
        """Call something in the event loop; raise LoopIsSilent if that takes too long."""
        answer: Future[T] = Future()

        def run() -> None:
            if not answer.set_running_or_notify_cancel():
                return  # nobody waits any more
            try:
                answer.set_result(what())
            except Exception as mistake:  # noqa: BLE001 - a bug of ours: raised where it was asked
                answer.set_exception(mistake)

        try:
            self._loop.call_soon_threadsafe(run)
        except RuntimeError as error:
            raise LoopIsSilent("the event loop has ended") from error
        try:
            async with asyncio.timeout(LOOP_WITHIN):
                return await asyncio.wrap_future(answer)
        except TimeoutError as error:
            words = f"the event loop did not answer within {LOOP_WITHIN:g} s"
            raise LoopIsSilent(words) from error


def dashboard() -> bytes:
    """Return the Grafana dashboard, as JSON."""
    return files("mav_tasks.metrics").joinpath(DASHBOARD).read_bytes()


def _note_failure(making: asyncio.Task[bytes]) -> None:
    """Retrieve an exception that no request waits for any more; asyncio would log it."""
    if not making.cancelled():
        making.exception()


def _labelled(raw: Iterable[Raw]) -> Iterator[Sample]:
    for values, figure in raw:
        yield tuple(map(_label, values)), figure


def _label(value: object) -> str:
    return value.name.lower() if isinstance(value, Enum) else str(value)


def _unavailable(why: str) -> Answer:
    return Answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{why}\n".encode())
