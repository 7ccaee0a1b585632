"""The handle of one task: query it, follow it, await it, change it."""

import asyncio
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING, Literal, Unpack

from mav_tasks.basics.errors import ClientError, TaskFailed
from mav_tasks.client.terms import Changes
from mav_tasks.client.values import TaskStatus, TaskTiming
from mav_tasks.client.watch import Followed
from mav_tasks.tasks.lifecycle import TaskState, words_of

if TYPE_CHECKING:
    from mav_tasks.client.aio import Client

Release = Literal["again", "remainder", "skip"]


class Task:
    """A handle of one task, valid while the client is open, even if the server restarts."""

    def __init__(self, client: "Client", followed: Followed) -> None:
        self._client = client
        self._followed = followed
        self._waiting: set[asyncio.Future[None]] = set()
        self._is_closed = False

    def __repr__(self) -> str:
        state = "not heard of yet" if self.status is None else self.status.state.name
        return f"Task({self.id}, {state})"

    @property
    def id(self) -> int:
        """The task id. The server does not reuse it while the task can be queried."""
        return self._followed.id

    @property
    def vehicle(self) -> int:
        """The system id of its rover. A task for any rover may get another one before it begins."""
        return self._followed.vehicle

    @property
    def status(self) -> TaskStatus | None:
        """The last status received; None before the first."""
        return self._followed.status

    @property
    def series(self) -> int | None:
        """The id of the first run of its series; None: it is in none, or no status has come yet."""
        return None if self.status is None else self.status.series

    async def done(self) -> TaskStatus:
        """Wait until the task has ended. Return its final status.

        Raise TaskFailed unless it completed. Use ``asyncio.timeout`` to limit the wait; the task
        continues after a time-out.
        """
        while not self._followed.is_over:
            await self._news()
        status = self.status
        if status is None or self._followed.is_lost:
            words = f"task {self.id}: the server no longer knows it"
            raise TaskFailed(words, task_id=self.id, state=0, reason=0)
        if status.state is not TaskState.COMPLETED:
            state, why = status.state.name.lower(), words_of(status.reason)
            is_more = status.reason and why != state
            words = f"task {self.id} {state}" + (f": {why}" if is_more else "")
            raise TaskFailed(words, task_id=self.id, state=status.state, reason=status.reason)
        return status

    async def updates(self, *, interval: float = 0.5) -> AsyncIterator[TaskStatus]:
        """Yield the status now, at each change, and every ``interval`` seconds while it is driven.

        The final status is the last one. A slow reader gets only the latest status.
        """
        told: TaskStatus | None = None
        while True:
            rover = self.vehicle
            with self._client.streaming(rover, interval):
                while self.vehicle == rover:
                    status = self.status
                    if status is not None and status is not told:
                        told = status
                        yield status
                    if self.status is not told:
                        continue  # it changed while the reader was busy
                    if self._followed.is_over:
                        return
                    await self._news()

    async def refresh(self) -> TaskStatus:
        """Request and return the status. Raise Refused (NOT_FOUND) if the server lacks the task."""
        return await self._client.status(self.id, vehicle=self.vehicle)

    async def timing(self) -> TaskTiming:
        """Return how evenly its setpoints have left so far; also works after the end."""
        return await self._client.timing(self.id, vehicle=self.vehicle)

    async def cancel(self, *, series: bool = False) -> None:
        """Cancel the task; if it is being driven, the rover stops at once.

        ``done`` waits for standstill. ``series``: also all further runs of its series, if it
        repeats. Raise Refused if the task, or with ``series`` its series, has ended.
        """
        await self._client.cancel(self.id, series=series, vehicle=self.vehicle)

    async def kill(self) -> None:
        """Cancel the task and put the rover into HOLD; no task starts until it stands still."""
        await self._client.kill(self.id, vehicle=self.vehicle)

    async def modify(self, **changes: Unpack[Changes]) -> None:
        """Change the task: see ``Client.modify``."""
        await self._client.modify(self.id, vehicle=self.vehicle, **changes)

    async def release(self, how: Release) -> None:
        """Release the task: "again" restarts it here, "remainder" finishes it, "skip" drops it."""
        await self._client.release(self.id, how, vehicle=self.vehicle)

    def wake(self) -> None:
        """Wake the waiting coroutines. The client calls it when the status changes."""
        for future in self._waiting:
            if not future.done():
                future.set_result(None)

    def close(self) -> None:
        """End the waiting coroutines with ClientError. The client calls it when it closes."""
        self._is_closed = True
        for future in self._waiting:
            if not future.done():
                future.set_exception(ClientError("the client was closed"))

    async def _news(self) -> None:
        if self._is_closed:
            raise ClientError("the client was closed")
        future = asyncio.get_running_loop().create_future()
        self._waiting.add(future)
        self._followed.listeners += 1
        self._client.rearm()
        try:
            await future
        finally:
            self._followed.listeners -= 1
            self._waiting.discard(future)
