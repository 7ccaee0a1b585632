"""The common parts of the rows: submit, wait with a limit, observe the rover's place."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TypeVar

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused, UsageError
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.values import TaskStatus, VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.field_trial.ground import Ground, Limits
from rover_sim.field_trial.track import Place, Track

T = TypeVar("T")

LOOK = 0.1  # s between two checks of a condition
SAMPLE = 0.05  # s between two samples of the reported place
ASK = 0.5  # s between two requests for a task's state
FOUND_WITHIN = 60.0  # s; an ArduPilot restarts within 10 s, PX4 within 5 s
STANDS_WITHIN = 8.0  # s
RELEASED_WITHIN = 60.0  # s that a released task waits for a booting rover: ArduPilot, 41 s
SETTLE = 0.6  # s at rest before a measurement: the window of ``Track.stands`` and a margin


class TrialError(Exception):
    """A row cannot continue; the message has the reason."""


@dataclass(frozen=True, slots=True)
class End:
    """The end of a task, or its time-out."""

    state: str
    words: str
    seconds: float

    @property
    def is_completed(self) -> bool:
        """Whether the task is completed."""
        return self.state == TaskState.COMPLETED.name

    def __str__(self) -> str:
        return self.state if self.is_completed else f"{self.state} ({self.words})"


class Session:
    """One client of one server, and the rover's track."""

    def __init__(
        self,
        ground: Ground,
        *,
        limits: Limits,
        say: Callable[[str], None],
    ) -> None:
        self.ground = ground
        self.limits = limits
        self.say = say
        self.told = Track()
        self._client: Client | None = None
        self._sampling: asyncio.Task[None] | None = None
        self._said = ""  # why a task waits

    # server and client

    async def begin(self) -> None:
        """Start the server and connect a client."""
        await self.ground.start_server()
        await self.connect()

    async def connect(self) -> None:
        """Connect a client to the running server; wait for the rover and its position."""
        await self.disconnect()
        client = self.ground.client()
        client.open()
        self._client = client
        await self.until(self._is_found, within=FOUND_WITHIN, what="a rover at the server")
        if self._sampling is None:
            self._sampling = asyncio.ensure_future(self._sample())
        await self.until(lambda: len(self.track) > 0, within=20.0, what="the rover's position")

    async def disconnect(self) -> None:
        """Close the client."""
        client, self._client = self._client, None
        if client is not None:
            await client.close()

    async def end(self) -> None:
        """Close the client and end the server."""
        if self._sampling is not None:
            self._sampling.cancel()
            with suppress(asyncio.CancelledError):
                await self._sampling
            self._sampling = None
        await self.disconnect()
        await self.ground.end_server()

    # state

    @property
    def client(self) -> Client:
        """The connected client. Raise TrialError if there is none."""
        if self._client is None:
            raise TrialError("no client")
        return self._client

    @property
    def now(self) -> float:
        """Time of the loop's clock, s."""
        return asyncio.get_running_loop().time()

    @property
    def track(self) -> Track:
        """The true track if known, else the reported one."""
        return self.told if self.ground.truth is None else self.ground.truth

    @property
    def rover(self) -> VehicleStatus | None:
        """The server's status of the rover, or None."""
        found = () if self._client is None else self._client.vehicles()
        return found[0] if found else None

    @property
    def is_px4(self) -> bool:
        """Whether the rover is a PX4."""
        return self.rover is not None and self.rover.kind == "px4"

    def told_place(self) -> Place:
        """Return the last reported place."""
        return self.told.last

    # waiting

    async def until(self, condition: Callable[[], bool], *, within: float, what: str) -> None:
        """Wait for a condition. Raise TrialError with ``what`` if it does not hold in time."""
        if not await self.comes_true(condition, within=within):
            raise TrialError(f"{what}: not within {within:g} s")

    async def comes_true(self, condition: Callable[[], bool], *, within: float) -> bool:
        """Wait for a condition; return whether it held in time."""
        end = self.now + within
        while not condition():
            if self.now >= end:
                return False
            await asyncio.sleep(LOOK)
        return True

    async def rest(self, *, within: float = STANDS_WITHIN) -> Place:
        """Wait until the rover stands; return its place."""
        await asyncio.sleep(SETTLE)
        await self.comes_true(self.track.stands, within=within)
        return self.track.last

    # tasks

    async def submit(self, goals: Goal | Sequence[Goal], *, within: float = 20.0) -> Task:
        """Submit, and repeat without an answer. Raise Refused, or NoAnswer after ``within``."""
        end, nonce = self.now + within, 0
        while True:
            try:
                return await self.client.submit(goals, nonce=nonce)
            except NoAnswer as error:
                nonce = error.nonce
                if self.now >= end:
                    raise

    async def outcome(self, task: Task, *, within: float) -> End:
        """Wait until a task is over or needs a decision; cancel it after ``within`` seconds."""
        begun = self.now
        status: TaskStatus | None = None
        driven_at = begun
        while self.now < begun + within:
            with suppress(NoAnswer):
                status = await self._status(task)
                if status.state is not TaskState.HELD:
                    driven_at = self.now
                late = self.now > driven_at + RELEASED_WITHIN
                if status.is_over or late or await self._waits_for_somebody(status):
                    return End(status.state.name, status.words, self.now - begun)
            await asyncio.sleep(ASK)
        with suppress(ClientError):
            await self.client.cancel(task.id)
        words = "no answer" if status is None else f"{status.state.name.lower()}: {status.words}"
        return End("TIMEOUT", f"{words}, after {within:g} s", self.now - begun)

    async def _status(self, task: Task) -> TaskStatus:
        """Return a task's state; say why it waits. Raise UsageError if it waits for a setting."""
        status = await self.client.status(task.id)
        if status.state is TaskState.QUEUED and status.reason is TaskReason.LOSS_FAILSAFE:
            raise UsageError(
                "the rover might drive on when setpoints end, so no task starts. First run:"
                " mav-tasks probe --set-failsafe and the rover's URL"
            )
        if status.state is TaskState.QUEUED and status.words != self._said:
            self._said = status.words
            self.say(f"  {status.words}")
        return status

    async def _waits_for_somebody(self, status: TaskStatus) -> bool:
        """Return whether a person must decide; a released task stays held until it starts."""
        if status.state is not TaskState.HELD:
            return False
        return (await self.client.queue(limit=0)).paused is not None

    async def drive(self, goals: Goal | Sequence[Goal], *, within: float) -> End:
        """Submit and wait for the end; a refusal is an end, too."""
        try:
            task = await self.submit(goals)
        except Refused as refused:
            return End("REFUSED", str(refused), 0.0)
        return await self.outcome(task, within=within)

    async def running_since(self, task: Task, distance: float, *, within: float) -> Place:
        """Wait until the rover has moved this far; return its start. Raise TrialError."""
        begun, end = self.track.last, self.now + within
        while not await self.comes_true(lambda: self.track.last.apart(begun) >= distance, within=1):
            with suppress(NoAnswer):
                await self._status(task)
            if self.now >= end:
                raise TrialError(f"task {task.id} driving {distance:g} m: not within {within:g} s")
        return begun

    async def clean(self) -> None:
        """Cancel every task and resume the queue."""
        for action in (lambda: self.client.clear(running_too=True), self._skip, self._resume):
            await quietly(action)
        await self.rest()

    async def _skip(self) -> None:
        await self.client.release(None, "skip")

    async def _resume(self) -> None:
        queue = await self.client.queue(limit=0)
        if queue.paused is not None:
            await self.client.resume()

    # internals

    def _is_found(self) -> bool:
        rover = self.rover
        return rover is not None and rover.is_heard and rover.north is not None

    async def _sample(self) -> None:
        while True:
            rover = self.rover
            if rover is not None and None not in (rover.north, rover.east, rover.yaw):
                assert rover.north is not None
                assert rover.east is not None
                assert rover.yaw is not None
                self.told.add(Place(self.now, rover.north, rover.east, rover.yaw))
            await asyncio.sleep(SAMPLE)


async def quietly(action: Callable[[], Awaitable[object]]) -> None:
    """Run the action; ignore a refusal or a missing answer."""
    with suppress(ClientError):
        await action()
