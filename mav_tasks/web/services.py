"""The objects that the operations of the API share."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar

from mav_tasks.basics.errors import MavTasksError, NoSuchVehicle, Refused, StoreError
from mav_tasks.client.aio import Client
from mav_tasks.client.values import TaskStatus
from mav_tasks.kinds import GoTo
from mav_tasks.mavlink.address import who_is
from mav_tasks.tasks.goal import Plan
from mav_tasks.web.goal_places import places_of_goals
from mav_tasks.web.journal import Journal
from mav_tasks.web.live import Live
from mav_tasks.web.operation import Call, Handler
from mav_tasks.web.problems import Problem, not_found
from mav_tasks.web.records import Records
from mav_tasks.web.sessions import Sessions
from mav_tasks.web.tiles import Tiles
from mav_tasks.web.users import Line, Users

T = TypeVar("T")


@dataclass(slots=True)
class Services:
    """``client``: of the web process, for all reading. ``journal``: None: no store."""

    client: Client
    live: Live
    users: Users
    sessions: Sessions
    instance: str
    server: str
    journal: Journal | None = None
    tiles: Tiles | None = None
    records: Records | None = None
    #: one reader of the journal at a time: several would take the interpreter from the event loop
    _reading: asyncio.Lock = field(default_factory=asyncio.Lock)
    _looking: set[asyncio.Task[None]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.live.on_unknown_places = self._look_up_places

    def _look_up_places(self, task: int) -> None:
        """Read the places of another client's plan from the journal, in the background."""
        if self.journal is None:
            return
        looking = asyncio.get_running_loop().create_task(self._remember_places(self.journal, task))
        self._looking.add(looking)
        looking.add_done_callback(self._looking.discard)

    async def look_up_user(self, task: int) -> None:
        """Read from the journal who submitted a task, unless that is known: no status has names."""
        if self.journal is None or task in self.live.users:
            return
        with suppress(StoreError):  # then it is said by which program
            async with self._reading:
                submitted = await asyncio.to_thread(self.journal.submission_of, task)
            if submitted is not None:
                self.live.remember_user(task, who_is(str(submitted.submitter)))

    async def _remember_places(self, journal: Journal, task: int) -> None:
        with suppress(StoreError):  # the map lacks the places; nothing else does
            async with self._reading:
                submitted = await asyncio.to_thread(journal.submission_of, task)
            goal = None if submitted is None else submitted.goal
            steps = goal.steps if isinstance(goal, Plan) else ()
            places = places_of_goals([step for step in steps if isinstance(step, GoTo)])
            if places:
                self.live.remember_places(task, places)
                self.live.show_again(task)

    def asks(self, handler: Callable[[Call, Client], Awaitable[Any]]) -> Handler:
        """Return a handler that gets the client of the user who calls, once it has the server."""

        async def run(call: Call) -> Any:
            line = await self.users.open(call.identity)
            if line.client is not self.client:
                await line.client.found()
            return await handler(call, line.client)

        return run

    def rover_of(self, call: Call) -> int:
        """Return the rover of a request; raise NoSuchVehicle if the server does not have it."""
        if not self.client.some_vehicles({call.vehicle}):
            ids = ", ".join(str(each.id) for each in self.client.vehicles()) or "none"
            raise NoSuchVehicle(f"no rover {call.vehicle}; the server has: {ids}")
        return call.vehicle

    async def status_of(self, call: Call) -> TaskStatus:
        """Return the status of a request's task. The server of any rover knows those of all."""
        rovers = self.client.vehicles()
        if not rovers:
            raise NoSuchVehicle("the server has no rover")
        return await self.client.status(call.task, vehicle=rovers[0].id)

    async def halted(self, call: Call, send: Callable[[Line], Awaitable[T]]) -> T:
        """Halt by the user's connection if it is up; without an answer, by that of the process."""
        *others, last = self.users.ways_to_halt(call.identity)
        for line in others:
            try:
                return await send(line)
            except Refused:
                raise
            except MavTasksError:  # the next one goes at once
                continue
        return await send(last)

    async def entries(
        self, *, task: int | None, vehicle: int | None = None, after: int | None = None, limit: int
    ) -> list[dict[str, Any]]:
        """Return events of the journal; raise Problem if there is none, or it cannot be read."""
        if self.journal is None:
            raise not_found("the web process has no store: start it with --store")
        try:
            async with self._reading:
                return await asyncio.to_thread(
                    self.journal.entries, task=task, vehicle=vehicle, after=after, limit=limit
                )
        except StoreError as error:
            raise Problem(503, "The journal cannot be read", str(error)) from error

    def is_still_known(self, call: Call) -> bool:
        """Return whether the session of a request, or its key, is still valid."""
        if call.session is not None:
            return self.sessions.key_of(call.session) is not None
        key = call.identity.key
        return not self.users.are_any if key is None else self.users.has(key)
