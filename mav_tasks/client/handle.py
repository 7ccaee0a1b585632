"""A task in a script's hands: asked, watched, awaited, changed."""

import asyncio
from collections.abc import AsyncIterator
from datetime import datetime
from typing import TYPE_CHECKING, Literal

from mav_tasks.client.values import TaskStatus, TaskTiming
from mav_tasks.client.watch import Followed
from mav_tasks.errors import ClientError, TaskFailed
from mav_tasks.tasks.lifecycle import TaskState, words_of

if TYPE_CHECKING:
    from mav_tasks.client.aio import Client

Release = Literal["again", "remainder", "skip"]


class Task:
    """One task of one server. It stays good while the client is open, also over the server's end
    and return.
    """

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
        """Its number, which the server gives to no other while it may be asked for."""
        return self._followed.id

    @property
    def vehicle(self) -> int:
        """The system id of its rover."""
        return self._followed.vehicle

    @property
    def status(self) -> TaskStatus | None:
        """What was heard of it last; None before anything was."""
        return self._followed.status

    async def done(self) -> TaskStatus:
        """Wait until it is over, and give its last status.

        Raises TaskFailed if it ended in another way than completed. To wait for so long only is
        ``asyncio.timeout``'s; the task goes on then.
        """
        while not self._followed.is_over:
            await self._news()
        status = self.status
        if status is None or self._followed.is_lost:
            words = f"task {self.id}: the server does not know it any more"
            raise TaskFailed(words, task_id=self.id, state=0, reason=0)
        if status.state is not TaskState.COMPLETED:
            state, why = status.state.name.lower(), words_of(status.reason)
            is_more = status.reason and why != state
            words = f"task {self.id} {state}" + (f": {why}" if is_more else "")
            raise TaskFailed(words, task_id=self.id, state=status.state, reason=status.reason)
        return status

    async def updates(self, *, interval: float = 0.5) -> AsyncIterator[TaskStatus]:
        """Yield its status now and at each change, while it is driven each ``interval`` seconds.

        Ends with the status in which the task is over. Who reads slowly gets the latest only.
        """
        with self._client.streaming(self.vehicle, interval):
            told: TaskStatus | None = None
            while True:
                status = self.status
                if status is not None and status is not told:
                    told = status
                    yield status
                if self._followed.is_over:
                    return
                if self.status is told:
                    await self._news()

    async def refresh(self) -> TaskStatus:
        """Ask the server how it is now. Refused (NOT_FOUND) if it does not know it."""
        return await self._client.status(self.id, vehicle=self.vehicle)

    async def timing(self) -> TaskTiming:
        """Ask the server how evenly its setpoints have left so far; also after it is over."""
        return await self._client.timing(self.id, vehicle=self.vehicle)

    async def cancel(self) -> None:
        """Call it off; if it is being driven the rover is stopped at once. Await ``done`` to see it
        stand. Raises Refused if it is over.
        """
        await self._client.cancel(self.id, vehicle=self.vehicle)

    async def kill(self) -> None:
        """The same, and the rover is put into HOLD; nothing else starts until it stands."""
        await self._client.kill(self.id, vehicle=self.vehicle)

    async def modify(
        self,
        *,
        priority: int | None = None,
        delay: float | None = None,
        deadline: float | None = None,
        after: "int | Task | None" = None,
        preemptible: bool | None = None,
        preemptive: bool | None = None,
        at: datetime | None = None,
        label: str | None = None,
    ) -> None:
        """Change what is given: see ``Client.modify``."""
        await self._client.modify(
            self.id,
            vehicle=self.vehicle,
            priority=priority,
            delay=delay,
            deadline=deadline,
            after=after,
            preemptible=preemptible,
            preemptive=preemptive,
            at=at,
            label=label,
        )

    async def release(self, how: Release) -> None:
        """Decide about it if it is held: all of it again from here, the remainder, or skip it."""
        await self._client.release(self.id, how, vehicle=self.vehicle)

    def wake(self) -> None:
        """There is news; the client calls it."""
        for future in self._waiting:
            if not future.done():
                future.set_result(None)

    def close(self) -> None:
        """There will be no more news; the client calls it."""
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
