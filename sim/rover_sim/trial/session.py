"""The common ground of the rows: a server, its client, and the rover's track."""

import asyncio
import shlex
from collections.abc import Awaitable, Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from pymavlink.dialects.v20 import development as mav

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused, UsageError
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.values import TaskStatus, VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.links.base import Link
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from rover_sim.observing.driver import Driver
from rover_sim.observing.observer import Observer, until
from rover_sim.observing.track import Place, Track

LOOK = 0.1  # s between two looks at a condition
SAMPLE = 0.05  # s between two samples of the reported place
ASK = 0.5  # s between two requests for a task's state
FOUND_WITHIN = 60.0  # s; an ArduPilot restarts within 10 s, PX4 within 5 s
POSITION_WITHIN = 20.0  # s
STANDS_WITHIN = 8.0  # s
BEAT_WITHIN = 3.0  # s, for a heartbeat once no server runs
RELEASED_WITHIN = 60.0  # s that a released task waits for a booting rover: ArduPilot, 41 s
SETTLE = 0.6  # s at rest before a measurement: the track's window and a margin
EVEN_WHILE_ARMED = 20190226.0  # param6 of PREFLIGHT_REBOOT_SHUTDOWN
NO_FAILSAFE = (
    "the rover might drive on when setpoints end, so no task starts. First run:"
    " mav-tasks probe --set-failsafe and the rover's URL"
)


class TrialError(Exception):
    """A row cannot continue; the message has the reason."""


class NotTried(Exception):
    """A row lacks something here; the message says what."""


class Result(NamedTuple):
    """What came of a row: words, whether they hold the limit, a figure, the limit."""

    words: str
    holds: bool
    figure: str = ""
    limit: str = ""


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of the rows; GUIDE.md shows measured values."""

    end: float = 0.05  # m, p95
    turn: float = 1.0  # deg, p95
    stop: float = 1.1  # times the distance of the better way
    stick: float = 1.5  # s
    remainder: float = 0.05  # m


class Server(Protocol):
    """A server that can be started again on the store of the one before."""

    async def start(self) -> None:
        """Start it."""

    async def end(self) -> None:
        """End it like SIGTERM, and wait for its end."""

    async def kill(self) -> None:
        """Kill it."""

    def why_ended(self) -> str:
        """Return in words why it has ended by itself, "" if it runs."""


@dataclass
class Ground:
    """A rover, a server for it, and what else there is."""

    server: Server
    client: Callable[[], Client]
    rover: Callable[[], Link]  # for use while no server runs
    truth: Track | None = None  # None: unknown, and the reported places count
    second: Observer | None = None  # on a second link to the rover
    reboot_command: str = ""

    @property
    def can_reboot(self) -> bool:
        """Whether there is a way to restart the rover."""
        return bool(self.reboot_command) or self.second is not None

    @property
    def can_push_stick(self) -> bool:
        """Whether there is a second link."""
        return self.second is not None

    async def reboot(self) -> None:
        """Restart the rover's autopilot. Raise TrialError if that is refused."""
        if self.reboot_command:
            process = await asyncio.create_subprocess_exec(
                *shlex.split(self.reboot_command),
                stdout=asyncio.subprocess.DEVNULL,
                start_new_session=True,
            )
            if await process.wait():
                raise TrialError(f"{self.reboot_command}: exit status {process.returncode}")
        elif self.second is not None:
            number = mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
            answer = await self.second.command(number, 1, 0, 0, 0, 0, EVEN_WHILE_ARMED)
            if answer.is_refused:
                raise TrialError(f"it does not restart: {answer}; try --reboot-command")

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle at a pulse (µs) until the next call; None releases it."""
        if self.second is not None:
            self.second.push_stick(throttle)


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


@dataclass
class Session:
    """One client of one server, and the rover's track."""

    ground: Ground
    limits: Limits
    say: Callable[[str], None]
    best: float | None = None  # m, shortest stopping distance from 1 m/s
    told: Track = field(default_factory=Track)
    _client: Client | None = None
    _sampling: asyncio.Task[None] | None = None
    _said: str = ""  # why a task waits

    # server and client

    async def begin(self) -> None:
        """Start the server, connect a client, and wait for the rover and its position."""
        await self.ground.server.start()
        client = self._client = self.ground.client()
        client.open()
        await self.until(self.is_found, within=FOUND_WITHIN, what="a rover at the server")
        if self._sampling is None:
            self._sampling = asyncio.ensure_future(self._sample())
        await self.until(lambda: len(self.track) > 0, within=POSITION_WITHIN, what="its position")

    async def disconnect(self) -> None:
        """Close the client."""
        client, self._client = self._client, None
        if client is not None:
            await client.close()

    async def end(self) -> None:
        """Stop the rover, and end the server."""
        try:
            if self.rover is not None:
                await quietly(lambda: self.client.stop(within=2.0))
            if self._sampling is not None:
                self._sampling.cancel()
            await self.disconnect()
        finally:
            await self.ground.server.end()
            await self._stop_without_server()

    async def _stop_without_server(self) -> None:
        """Bring the rover to rest if it still follows setpoints, as after a killed server."""
        with closing(Observer(self.ground.rover())) as observer:
            driver = Driver(observer)
            if await observer.found(BEAT_WITHIN) and driver.mode == driver.make.control:
                await driver.rest()

    # state

    @property
    def client(self) -> Client:
        """The connected client."""
        assert self._client is not None
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

    def is_found(self) -> bool:
        """Return whether the server hears the rover and knows its place."""
        if why := self.ground.server.why_ended():
            raise TrialError(f"the server has ended: {why}")
        return self.rover is not None and self.rover.is_heard and self.rover.north is not None

    # waiting

    async def until(self, condition: Callable[[], object], *, within: float, what: str) -> None:
        """Wait for a condition. Raise TrialError with ``what`` if it does not hold in time."""
        if not await until(condition, within):
            raise TrialError(f"{what}: not within {within:g} s")

    async def rest(self) -> Place:
        """Wait until the rover stands; return its place."""
        await asyncio.sleep(SETTLE)
        await until(self.track.stands, STANDS_WITHIN)
        return self.track.last

    # tasks

    async def submit(self, goals: Goal | Sequence[Goal]) -> Task:
        """Submit, and repeat once without an answer. Raise Refused or NoAnswer."""
        try:
            return await self.client.submit(goals)
        except NoAnswer as error:
            return await self.client.submit(goals, nonce=error.nonce)

    async def outcome(self, task: Task, *, within: float) -> End:
        """Wait until a task is over or needs a decision; cancel it after ``within`` seconds."""
        begun = driven_at = self.now
        words = "no answer"
        while self.now < begun + within:
            with suppress(NoAnswer):
                status = await self._status(task)
                words = f"{status.state.name.lower()}: {status.words}"
                is_held = status.state is TaskState.HELD
                driven_at = driven_at if is_held else self.now
                late = self.now > driven_at + RELEASED_WITHIN
                # a released task stays held until it starts
                waits = is_held and (await self.client.queue(limit=0)).paused is not None
                if status.is_over or late or waits:
                    return End(status.state.name, status.words, self.now - begun)
            await asyncio.sleep(ASK)
        await quietly(lambda: self.client.cancel(task.id))
        return End("TIMEOUT", f"{words}, after {within:g} s", self.now - begun)

    async def _status(self, task: Task) -> TaskStatus:
        """Return a task's state; say why it waits. Raise UsageError if it waits for a setting."""
        status = await self.client.status(task.id)
        if status.state is TaskState.QUEUED and status.reason is TaskReason.LOSS_FAILSAFE:
            raise UsageError(NO_FAILSAFE)
        if status.state is TaskState.QUEUED and status.words != self._said:
            self._said = status.words
            self.say(f"  {status.words}")
        return status

    async def drive(self, goals: Goal | Sequence[Goal], *, within: float) -> End:
        """Submit and wait for the end; a refusal is an end, too."""
        try:
            return await self.outcome(await self.submit(goals), within=within)
        except Refused as refused:
            return End("REFUSED", str(refused), 0.0)

    async def running_since(self, task: Task, distance: float) -> Place:
        """Wait until the rover has moved this far; return its start. Raise TrialError."""
        begun, end = self.track.last, self.now + FOUND_WITHIN
        while self.track.last.apart(begun) < distance:
            with suppress(NoAnswer):
                await self._status(task)
            if self.now >= end:
                raise TrialError(f"task {task.id}: no {distance:g} m within {FOUND_WITHIN:g} s")
            await asyncio.sleep(LOOK)
        return begun

    async def clean(self) -> None:
        """Cancel every task and resume the queue."""
        await quietly(lambda: self.client.clear(running_too=True))
        await quietly(lambda: self.client.release(None, "skip"))
        await quietly(self.client.resume)
        await self.rest()

    async def _sample(self) -> None:
        while True:
            match self.rover:
                case VehicleStatus(north=float(north), east=float(east), yaw=float(yaw)):
                    self.told.add(Place(self.now, north, east, yaw))
            await asyncio.sleep(SAMPLE)


async def quietly(action: Callable[[], Awaitable[object]]) -> None:
    """Run the action; ignore a refusal or a missing answer."""
    with suppress(ClientError):
        await action()
