"""The blocking client: the calls of the asyncio client, each waiting for its answer.

The asyncio client runs on an event loop in its own thread, or where a given Portal runs it. It
sends heartbeats and receives statuses while the script does other things.
"""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self, TypeVar

from mav_tasks.client.aio import (
    DEFAULT_LINK,
    FIND_WITHIN,
    SCRIPT,
    STOP_WITHIN,
    Client,
)
from mav_tasks.client.handle import Release, Task
from mav_tasks.client.plan_sources import Plan
from mav_tasks.client.values import QueueStatus, TaskStatus, TaskTiming, Text, VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.errors import ClientError, MavTasksError
from mav_tasks.links.base import Link
from mav_tasks.mavlink.signing import Key
from mav_tasks.plan_files import PlanFile
from mav_tasks.services.mission_item import Item
from mav_tasks.tasks.task import DEFAULT_PRIORITY

T = TypeVar("T")

ENDS_BY_ITSELF = 0.2  # s until ``close`` cancels a coroutine


class Portal(Protocol):
    """Runs coroutines for a caller that blocks."""

    def call(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine to its end. Return its result, or raise its exception."""
        ...

    def close(self) -> None:
        """Free the portal's resources."""
        ...


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


class SyncTask:
    """A blocking handle of one task; see ``Task``."""

    def __init__(self, task: Task, portal: Portal) -> None:
        self._task = task
        self._portal = portal

    def __repr__(self) -> str:
        return f"Sync{self._task!r}"

    @property
    def id(self) -> int:
        """The task id. The server does not reuse it while the task can be queried."""
        return self._task.id

    @property
    def vehicle(self) -> int:
        """The system id of its rover."""
        return self._task.vehicle

    @property
    def status(self) -> TaskStatus | None:
        """The last status received; None before the first."""
        return self._task.status

    def done(self, *, timeout: float | None = None) -> TaskStatus:
        """Wait until the task has ended. Return its final status.

        Raise TaskFailed unless it completed. Raise TimeoutError after ``timeout`` seconds; the
        task continues.
        """

        async def within() -> TaskStatus:
            try:
                async with asyncio.timeout(timeout):
                    return await self._task.done()
            except TimeoutError:
                now = "not heard of" if self.status is None else self.status.words
                words = f"task {self.id} has not ended after {timeout:g} s: {now}"
                raise TimeoutError(words) from None

        return self._portal.call(within())

    def updates(self, *, interval: float = 0.5) -> Iterator[TaskStatus]:
        """Yield the status now, at each change, and every ``interval`` s while it is driven."""
        return _each(self._task.updates(interval=interval), self._portal)

    def refresh(self) -> TaskStatus:
        """Request and return the status."""
        return self._portal.call(self._task.refresh())

    def timing(self) -> TaskTiming:
        """Return how evenly its setpoints have left so far; also works after the end."""
        return self._portal.call(self._task.timing())

    def cancel(self) -> None:
        """Cancel the task; see ``Task.cancel``."""
        self._portal.call(self._task.cancel())

    def kill(self) -> None:
        """Cancel the task and put the rover into HOLD."""
        self._portal.call(self._task.kill())

    def modify(
        self,
        *,
        priority: int | None = None,
        delay: float | None = None,
        deadline: float | None = None,
        after: "int | SyncTask | None" = None,
        preemptible: bool | None = None,
        preemptive: bool | None = None,
        at: datetime | None = None,
        label: str | None = None,
    ) -> None:
        """Change the task: see ``Client.modify``."""
        self._portal.call(
            self._task.modify(
                priority=priority,
                delay=delay,
                deadline=deadline,
                after=None if after is None else _id_of(after),
                preemptible=preemptible,
                preemptive=preemptive,
                at=at,
                label=label,
            )
        )

    def release(self, how: Release) -> None:
        """Release the held task: see ``Task.release``."""
        self._portal.call(self._task.release(how))


class SyncClient:
    """A connection to a task server, with the methods of ``Client``.

    It is open within a ``with`` block. ``portal`` runs its asyncio part.
    """

    def __init__(
        self,
        link: str | Link = DEFAULT_LINK,
        *,
        vehicle: int | None = None,
        timeout: float = FIND_WITHIN,
        system_id: int = SCRIPT.system_id,
        component_id: int = SCRIPT.component_id,
        key: Key | bytes | None = None,
        link_id: int | None = None,
        portal: Portal | None = None,
    ) -> None:
        self._make: Callable[[], Client] = lambda: Client(
            link,
            vehicle=vehicle,
            timeout=timeout,
            system_id=system_id,
            component_id=component_id,
            key=key,
            link_id=link_id,
        )
        self._given = portal
        self._portal: Portal | None = None
        self._client: Client | None = None

    def __repr__(self) -> str:
        return f"Sync{self._client!r}" if self._client else "SyncClient(closed)"

    def __enter__(self) -> Self:
        self.open()
        try:
            self.found()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def open(self) -> None:
        """Open the link without waiting."""
        if self._portal is not None:
            raise MavTasksError(f"{self!r}: it is open already")
        portal = self._portal = self._given or ThreadPortal()
        try:
            self._client = portal.call(self._opened())
        except BaseException:
            self.close()
            raise

    def found(self) -> None:
        """Wait for the task server: see ``Client.found``."""
        self._call(lambda client: client.found())

    def close(self) -> None:
        """Close the link. The server continues the tasks."""
        client, self._client = self._client, None
        portal, self._portal = self._portal, None
        if portal is None:
            return
        if client is not None:
            portal.call(client.close())
        if portal is not self._given:
            portal.close()

    def submit(
        self,
        goal: Goal | Sequence[Goal],
        *,
        priority: int = DEFAULT_PRIORITY,
        after: int | SyncTask = 0,
        delay: float = 0.0,
        deadline: float = 0.0,
        at: datetime | None = None,
        vehicle: int | None = None,
        nonce: int = 0,
        label: str = "",
    ) -> SyncTask:
        """Submit a goal, or several as one task: see ``Client.submit``."""
        return self._task(
            lambda client: client.submit(
                goal,
                priority=priority,
                after=_id_of(after),
                delay=delay,
                deadline=deadline,
                at=at,
                vehicle=vehicle,
                nonce=nonce,
                label=label,
            )
        )

    def task(self, task_id: int, *, vehicle: int | None = None) -> SyncTask:
        """Return the handle of any client's task."""
        return self._task(lambda client: client.task(task_id, vehicle=vehicle))

    def status(self, task_id: int, *, vehicle: int | None = None) -> TaskStatus:
        """Return the status of a task."""
        return self._call(lambda client: client.status(task_id, vehicle=vehicle))

    def timing(self, task_id: int | None = None, *, vehicle: int | None = None) -> TaskTiming:
        """Return how evenly the setpoints of a task left; None: of the running task."""
        return self._call(lambda client: client.timing(task_id, vehicle=vehicle))

    def cancel(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """Cancel a task, None: the running one. Return its id."""
        return self._call(lambda client: client.cancel(task_id, vehicle=vehicle))

    def kill(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """Cancel a task and put the rover into HOLD at once. Return the task's id."""
        return self._call(lambda client: client.kill(task_id, vehicle=vehicle))

    def clear(self, *, running_too: bool = False, vehicle: int | None = None) -> None:
        """Cancel all waiting tasks; ``running_too``: the running one, too."""
        self._call(lambda client: client.clear(running_too=running_too, vehicle=vehicle))

    def modify(
        self,
        task_id: int,
        *,
        priority: int | None = None,
        delay: float | None = None,
        deadline: float | None = None,
        after: int | SyncTask | None = None,
        preemptible: bool | None = None,
        preemptive: bool | None = None,
        at: datetime | None = None,
        label: str | None = None,
        vehicle: int | None = None,
    ) -> None:
        """Change a task: see ``Client.modify``."""
        self._call(
            lambda client: client.modify(
                task_id,
                priority=priority,
                delay=delay,
                deadline=deadline,
                after=None if after is None else _id_of(after),
                preemptible=preemptible,
                preemptive=preemptive,
                at=at,
                label=label,
                vehicle=vehicle,
            )
        )

    def release(
        self,
        task_id: int | None,
        how: Release,
        *,
        epoch: int | None = None,
        vehicle: int | None = None,
    ) -> int:
        """Release a held task: see ``Client.release``."""
        return self._call(lambda client: client.release(task_id, how, epoch=epoch, vehicle=vehicle))

    def queue(self, *, vehicle: int | None = None, limit: int = 100) -> QueueStatus:
        """Return the running and the waiting tasks of a rover."""
        return self._call(lambda client: client.queue(vehicle=vehicle, limit=limit))

    def history(self, *, vehicle: int | None = None, limit: int = 20) -> tuple[TaskStatus, ...]:
        """Return finished tasks of a rover, newest first: see ``Client.history``."""
        return self._call(lambda client: client.history(vehicle=vehicle, limit=limit))

    def stop(
        self, *, clear: bool = False, vehicle: int | None = None, within: float = STOP_WITHIN
    ) -> None:
        """Stop all rovers, or only ``vehicle``, at once: see ``Client.stop``."""
        self._call(lambda client: client.stop(clear=clear, vehicle=vehicle, within=within))

    def pause(self, *, vehicle: int | None = None) -> None:
        """Stop the rover; its task can continue from there."""
        self._call(lambda client: client.pause(vehicle=vehicle))

    def resume(self, *, epoch: int | None = None, vehicle: int | None = None) -> None:
        """Resume after a pause, a STOP or a takeover."""
        self._call(lambda client: client.resume(epoch=epoch, vehicle=vehicle))

    def vehicles(self) -> tuple[VehicleStatus, ...]:
        """Return the last known state of the server's rovers."""

        async def vehicles(client: Client) -> tuple[VehicleStatus, ...]:
            return client.vehicles()

        return self._call(vehicles)

    def texts(self) -> Iterator[Text]:
        """Yield each STATUSTEXT of rovers and task servers from now on."""
        client, portal = self._opened_here()
        return _each(client.texts(), portal)

    def submit_mission(
        self,
        plan: Plan,
        *,
        priority: int = DEFAULT_PRIORITY,
        after: int | SyncTask = 0,
        delay: float = 0.0,
        deadline: float = 0.0,
        at: datetime | None = None,
        vehicle: int | None = None,
        nonce: int = 0,
        label: str = "",
    ) -> SyncTask:
        """Queue a mission as one task: see ``Client.submit_mission``."""
        return self._task(
            lambda client: client.submit_mission(
                plan,
                priority=priority,
                after=_id_of(after),
                delay=delay,
                deadline=deadline,
                at=at,
                vehicle=vehicle,
                nonce=nonce,
                label=label,
            )
        )

    def stage_mission(self, plan: Plan, *, vehicle: int | None = None) -> SyncTask:
        """Stage a mission: see ``Client.stage_mission``."""
        return self._task(lambda client: client.stage_mission(plan, vehicle=vehicle))

    def start_mission(self, *, epoch: int | None = None, vehicle: int | None = None) -> SyncTask:
        """Start the staged mission, or the last one again."""
        return self._task(lambda client: client.start_mission(epoch=epoch, vehicle=vehicle))

    def mission(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the staged mission, as it was uploaded."""
        return self._call(lambda client: client.mission(vehicle=vehicle))

    def mission_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the staged mission for ``write_plan``."""
        return self._call(lambda client: client.mission_file(vehicle=vehicle))

    def fence_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the fence for ``write_plan``."""
        return self._call(lambda client: client.fence_file(vehicle=vehicle))

    def fence(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the items of the fence."""
        return self._call(lambda client: client.fence(vehicle=vehicle))

    def set_fence(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the fence of a .plan file. Return the number of items."""
        return self._call(lambda client: client.set_fence(plan, vehicle=vehicle))

    def set_rally_points(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the rally points of a .plan file. Return their number."""
        return self._call(lambda client: client.set_rally_points(plan, vehicle=vehicle))

    async def _opened(self) -> Client:
        client = self._make()
        client.open()
        return client

    def _call(self, what: Callable[[Client], Coroutine[Any, Any, T]]) -> T:
        client, portal = self._opened_here()
        return portal.call(what(client))

    def _opened_here(self) -> tuple[Client, Portal]:
        if self._client is None or self._portal is None:
            raise MavTasksError(f"{self!r}: open it first, by 'with'")
        return self._client, self._portal

    def _task(self, what: Callable[[Client], Coroutine[Any, Any, Task]]) -> SyncTask:
        task = self._call(what)
        assert self._portal is not None, "it has just been used"
        return SyncTask(task, self._portal)


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


def _id_of(task: int | SyncTask) -> int:
    return task.id if isinstance(task, SyncTask) else task
