"""What the blocking client has besides its calls: it runs coroutines, opens and closes.

The asyncio client runs on an event loop in its own thread, or where a given Portal runs it. It
sends heartbeats and receives statuses while the script does other things. ``sync`` has the calls.
"""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import suppress
from typing import Any, Protocol, Self, TypeVar

from mav_tasks.basics.errors import ClientError, MavTasksError
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.values import TaskStatus

T = TypeVar("T")

ENDS_BY_ITSELF = 0.2  # s until ``close`` cancels a coroutine


class Portal(Protocol):
    """Runs coroutines for a caller that blocks."""

    def call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine to its end. Return its result, or raise its exception."""

    def close(self) -> None:
        """Free the portal's resources."""


class ThreadPortal:
    """An event loop in its own daemon thread."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="mav_tasks client", daemon=True
        )
        self._thread.start()

    def call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine; Ctrl-C cancels it. Raise ClientError if the portal is closed."""
        if self._loop.is_closed():
            coroutine.close()
            raise ClientError("the client was closed")
        future = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        try:
            return future.result()
        except BaseException:
            future.cancel()
            raise

    def close(self) -> None:
        """End the running coroutines, which other threads may wait for, and the thread."""
        asyncio.run_coroutine_threadsafe(self._end_tasks(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _end_tasks(self) -> None:
        await self._loop.shutdown_asyncgens()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        if others:
            await asyncio.wait(others, timeout=ENDS_BY_ITSELF)  # the client has told them to end
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.sleep(0)  # the next iteration wakes the waiting threads


class BlockingTask:
    """The base of ``SyncTask``."""

    def __init__(self, task: Task, portal: Portal) -> None:
        self._aio = task
        self._portal = portal

    def __repr__(self) -> str:
        return f"Sync{self._aio!r}"

    def done(self, *, timeout: float | None = None) -> TaskStatus:
        """Wait until the task has ended. Return its final status.

        Raise TaskFailed unless it completed. Raise TimeoutError after ``timeout`` seconds; the
        task continues.
        """

        async def within() -> TaskStatus:
            task = self._aio
            try:
                async with asyncio.timeout(timeout):
                    return await task.done()
            except TimeoutError:
                now = "not heard of" if task.status is None else task.status.words
                words = f"task {task.id} has not ended after {timeout:g} s: {now}"
                raise TimeoutError(words) from None

        return self._call(within())

    def _call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        return self._portal.call(coroutine)

    def _each(self, generator: AsyncIterator[T]) -> Iterator[T]:
        return _each(generator, self._portal)


class BlockingClient:
    """The base of ``SyncClient``. It is open within a ``with`` block."""

    def __init__(self, make: Callable[[], Client], portal: Portal | None) -> None:
        """``make`` makes the asyncio client, on its loop."""
        self._make = make
        self._given = portal
        self._portal: Portal | None = None
        self._client: Client | None = None

    def __repr__(self) -> str:
        return f"Sync{self._client!r}" if self._client else "SyncClient(closed)"

    def __enter__(self) -> Self:
        self._begin()
        try:
            self._call(self._aio.found())
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(self, *_error: object) -> None:
        self._end()

    @property
    def _aio(self) -> Client:
        return self._opened()[0]

    def _opened(self) -> tuple[Client, Portal]:
        if self._client is None or self._portal is None:
            raise MavTasksError(f"{self!r}: open it first, by 'with'")
        return self._client, self._portal

    def _begin(self) -> None:
        if self._portal is not None:
            raise MavTasksError(f"{self!r}: it is open already")

        async def opened() -> Client:
            client = self._make()
            client.open()
            return client

        portal = self._portal = self._given or ThreadPortal()
        try:
            self._client = portal.call(opened())
        except BaseException:
            self._end()
            raise

    def _end(self) -> None:
        client, self._client = self._client, None
        portal, self._portal = self._portal, None
        if portal is None:
            return
        if client is not None:
            portal.call(client.close())
        if portal is not self._given:
            portal.close()

    def _call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        return self._opened()[1].call(coroutine)

    def _handle(self, kind: Callable[[Task, Portal], T], coroutine: Coroutine[Any, Any, Task]) -> T:
        portal = self._opened()[1]
        return kind(portal.call(coroutine), portal)

    def _each(self, generator: AsyncIterator[T]) -> Iterator[T]:
        return _each(generator, self._opened()[1])


async def called(function: Callable[[], T]) -> T:
    """Call a function of the asyncio client, on its loop."""
    return function()


def _each(generator: AsyncIterator[T], portal: Portal) -> Iterator[T]:
    """Yield the values of an async generator as they arrive."""

    async def following() -> T | None:
        return await anext(generator, None)

    async def closed() -> None:
        await generator.aclose()  # type: ignore[attr-defined]  # all callers pass generators

    try:
        while (value := portal.call(following())) is not None:
            yield value
    finally:
        with suppress(ClientError):  # the portal is closed: nothing is left to end
            portal.call(closed())
