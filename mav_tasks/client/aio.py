"""The asyncio client. Messages of the server wake the coroutines that await them: no polling."""

import asyncio
from collections.abc import AsyncIterator, Callable, Container, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from math import nan
from pathlib import Path
from typing import Any, Self, Unpack
from weakref import WeakValueDictionary

from mav_tasks import plans as plan_files
from mav_tasks.basics.errors import ClientError, LinkDown, MavTasksError, NoAnswer, Refused
from mav_tasks.client import wire
from mav_tasks.client.asker import Asker
from mav_tasks.client.connection import Connection
from mav_tasks.client.descriptions import STOP_IN_FORCE
from mav_tasks.client.handle import Release, Task
from mav_tasks.client.plan_sources import Plan, file_of, items_of
from mav_tasks.client.session import TELEMETRY_RATE, Session
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.client.submissions import Submissions, utc_of
from mav_tasks.client.terms import (
    NOT_NUMBERS,
    OF_CHANGES,
    OF_NEW,
    PROPERTIES,
    AnyRover,
    Changes,
    CommonTerms,
    Terms,
    given,
    id_of,
)
from mav_tasks.client.values import (
    News,
    QueueStatus,
    TaskStatus,
    TaskTiming,
    Text,
    VehicleStatus,
    queue_status_of,
)
from mav_tasks.client.watch import Followed
from mav_tasks.client.wire import SERVER, Goal, TaskOptions
from mav_tasks.engine.services.missions import Item
from mav_tasks.kinds import Drive, Move, Rotate
from mav_tasks.kinds.sent import check_size
from mav_tasks.links.base import Link
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import (
    MavCmd,
    MavMissionType,
    MavResult,
    TaskProperty,
)
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.mavlink.label import check_label, text_pieces
from mav_tasks.mavlink.signing import Key
from mav_tasks.mavlink.special_values import EPOCHS, PAGE
from mav_tasks.plans import (
    PlanFile,
    fence_items,
    rally_items,
)
from mav_tasks.tasks.lifecycle import ACTIVE, TERMINAL, WAITING, TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_DELAY

DEFAULT_LINK = "udpout:127.0.0.1:14560"
#: not 255, so that a ground station and a script on one link differ
SCRIPT = Address(244, 190)
FIND_WITHIN = 5.0  # s
STOP_AGAIN = 0.1  # s between copies of a STOP
STOP_WITHIN = 3.0  # s
#: the first run of a cron expression waits so long, until the server knows that
UNTIL_REPEATED = MAX_DELAY
KILL = 1.0  # param2 of TASK_CANCEL
RESUME = 1.0  # param1 of DO_PAUSE_CONTINUE
NO_HISTORY = "the server does not list finished tasks: it is older than this client"
OVERTAKEN = "a later STOP or pause overtook this request: repeat it if you still mean it"
RELEASES: dict[Release, float] = {"again": 0.0, "remainder": 1.0, "skip": 2.0}


class Client:
    """A connection to a task server and, through the server, to its rovers.

    ``link`` is a URL of the server (``udpout:host:port``, ``tcp:host:port``,
    ``serial:device:baud``, or ``udpin:host:port`` if the server pushes), or an open Link.
    ``vehicle`` is the system id of the default rover; it can be left out if there is only one.
    ``timeout``: seconds to wait for a server and a rover.

    With a ``key`` of 32 bytes the client signs all packets (MAVLink 2) and drops packets that the
    server has not signed with this key. ``link_id``, 0 to 255, goes into the signatures; None: a
    random one. Raise ValueError if the key is invalid. ``telemetry_rate``: Hz of the rovers'
    position and attitude that the client asks for.

    Every method may raise NoAnswer, Refused and NoSuchVehicle.

    Use a client only on the event loop on which it was opened.
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
        telemetry_rate: int = TELEMETRY_RATE,
    ) -> None:
        self._link = link
        self._telemetry_rate = telemetry_rate
        self._signatures = None if key is None else ClientSignatures(key, link_id=link_id)
        self._vehicle = vehicle
        self._timeout = timeout
        self._address = Address(system_id, component_id)
        self._connection: Connection | None = None
        self._asker: Asker | None = None
        self._served = asyncio.Event()
        self._tasks: WeakValueDictionary[Followed, Task] = WeakValueDictionary()
        self._submissions = Submissions()
        self._halts = 0  # STOPs and pauses that this client requested

    def __repr__(self) -> str:
        return f"Client({self._link}, {'closed' if self._connection is None else 'open'})"

    # opening and closing

    async def __aenter__(self) -> Self:
        self.open()
        try:
            await self.found()
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(self, *_error: object) -> None:
        await self.close()

    def open(self) -> None:
        """Open the link without waiting. Raise LinkUrlError or LinkOpenError if that fails."""
        if self._connection is not None:
            raise MavTasksError(f"{self!r}: it is open already")
        connection = Connection(
            self._link,
            lambda now: Session(self._address, now=now, telemetry_rate=self._telemetry_rate),
            signatures=self._signatures,
        )
        session = connection.session
        session.on_served = self._served.set
        session.on_news = self._on_news
        self._connection, self._asker = connection, Asker(connection)

    async def found(self) -> None:
        """Wait until the task server of the default rover, or of each rover heard, has answered.

        Raise NoAnswer after ``timeout``; without a default rover only if none has answered.
        """
        session = self._open.session
        try:
            async with asyncio.timeout(self._timeout):
                while not self._open.session.fleet.is_found(self._vehicle):
                    self._served.clear()
                    await self._served.wait()
        except TimeoutError:
            if self._vehicle is None and session.fleet.served():
                return
            words = session.fleet.why_not_found(self._vehicle)
            where = f"on {self._open.link.name} within {self._timeout:g} s"
            words = words.format(where=where)
            if self._open.is_down:
                words = f"{self._open.link.name} {self._open.is_down}"
                raise LinkDown(words) from None
            if self._signatures is not None and not session.fleet.served():
                words = f"{words} And: {self._signatures.why_silent()}"
            raise NoAnswer(words) from None

    async def close(self) -> None:
        """Close the link. The server continues the tasks."""
        connection, self._connection = self._connection, None
        asker, self._asker = self._asker, None
        if connection is not None:
            connection.close()
        if asker is not None:
            asker.close()
        for task in list(self._tasks.values()):
            task.close()
        self._served.set()  # wakes ``found``

    # tasks

    async def submit(self, goal: Goal | Sequence[Goal], **terms: Unpack[Terms]) -> Task:
        """Submit a goal, or several goals in order as one task. Return once the task is durable.

        What ``terms`` there are, and mean, says ``mav_tasks.client.terms.Terms``.
        """
        goals = goal if isinstance(goal, Sequence) and not isinstance(goal, str) else (goal,)
        if not goals:
            raise ValueError("no goals: nothing to do")
        alone = goals[0] if len(goals) == 1 else None
        command = alone if isinstance(alone, Move | Rotate | Drive) else None
        return await self._submit(goals, command, **terms)

    async def task(self, task_id: int, *, vehicle: int | None = None) -> Task:
        """Return the handle of any client's task. Raise Refused (NOT_FOUND) for an unknown id."""
        system_id = self._which(vehicle)
        followed = self._open.session.follow(task_id, system_id, nonce=None, now=self._now)
        task = self._handle(followed)
        await self.status(task_id, vehicle=system_id)
        return task

    async def status(self, task_id: int, *, vehicle: int | None = None) -> TaskStatus:
        """Return the status of a task. Raise Refused (NOT_FOUND) if there is no task of this id."""
        return await self._ask.status(task_id, self._which(vehicle))

    async def timing(self, task_id: int | None = None, *, vehicle: int | None = None) -> TaskTiming:
        """Return how evenly the setpoints of a task left; None: of the running task.

        Raise Refused (NOT_FOUND) if there is no task of this id, or no task is running.
        """
        return await self._ask.timing(task_id or 0, self._which(vehicle))

    async def parameter(self, name: str, *, vehicle: int | None = None) -> float:
        """Return a parameter of the server, such as TSK_SPEED.

        Raise NoAnswer if the server has no parameter of this name.
        """
        return await self._ask.parameter(name, self._task_server(vehicle))

    async def cancel(
        self,
        task_id: int | None = None,
        *,
        series: bool = False,
        kill: bool = False,
        vehicle: int | None = None,
    ) -> int:
        """Cancel a task, by default the running one. Return its id. Raise Refused if none runs.

        If the task repeats, its next run stays planned. ``series``: cancel the present run of its
        series, and all further ones; ``task_id`` may be that of any run. ``kill``: put the rover
        into HOLD at once, which ends a series, too.
        """
        how = KILL if kill else 0.0
        return await self._cancel(task_id, how, vehicle, series=series and not kill)

    async def kill(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """Cancel a task and put the rover into HOLD at once. Return the task's id."""
        return await self.cancel(task_id, kill=True, vehicle=vehicle)

    async def clear(self, *, running_too: bool = False, vehicle: int | None = None) -> None:
        """Cancel all waiting tasks; ``running_too``: the running one, too."""
        await self._control(vehicle, MavCmd.TASK_CLEAR, 1.0 if running_too else 0.0)

    async def modify(
        self, task_id: int, *, vehicle: int | None = None, **changes: Unpack[Changes]
    ) -> None:
        """Change a task that has not ended.

        What ``changes`` there are, and mean, says ``mav_tasks.client.terms.Changes``.
        """
        terms = given(changes, OF_CHANGES)
        if (every := terms.get("every")) is not None:
            await self._set_repeat(task_id, wire.repeat_of(every), vehicle=vehicle)
        numbers = {
            name: to_param(id_of(value)) if name in ("after", "before") else float(value)
            for name, value in terms.items()
            if name not in NOT_NUMBERS
        }
        for name in ("deadline", "delay"):
            check_size(name, numbers.get(name, 0.0))
        # the delay last, as it may let the task start; a priority before a place: it ends one
        for name in sorted(filter(numbers.__contains__, PROPERTIES), key="delay".__eq__):
            params = to_param(task_id), float(PROPERTIES[name]), numbers[name]
            await self._control(vehicle, MavCmd.TASK_MODIFY, *params)
        if (at := terms.get("at")) is not None:
            await self._modify_exactly(
                task_id, TaskProperty.START_UTC, round(utc_of(at)), 0, nan, vehicle=vehicle
            )
        if (label := terms.get("label")) is not None:
            check_label(label)
            await self._write(
                task_id, TaskProperty.LABEL, label, lambda status: status.label, vehicle=vehicle
            )

    async def release(
        self,
        task_id: int | None,
        how: Release,
        *,
        epoch: int | None = None,
        vehicle: int | None = None,
    ) -> int:
        """Release a held task, None: the held one. Return its id.

        "again" restarts the task here, "remainder" finishes it, "skip" drops it. ``epoch`` as in
        ``resume``. If the queue is paused, the task continues on resume.
        """
        if how not in RELEASES:
            raise ValueError(f"{how!r}: expected one of {', '.join(RELEASES)}")
        seen = await self._seen(vehicle, epoch)
        params = to_param(task_id or 0), RELEASES[how], seen
        return await self._control(vehicle, MavCmd.TASK_RELEASE, *params)

    # the queue and the rovers

    async def queue(self, *, vehicle: int | None = None, limit: int = 100) -> QueueStatus:
        """Return the running task of a rover and up to ``limit`` of its waiting tasks."""
        system_id = self._which(vehicle)
        overview = await self._ask.overview(system_id)
        running = overview.running_id
        current = None
        if running:
            try:
                current = await self.status(running, vehicle=system_id)
            except Refused:
                current = None  # it ended meanwhile, and the server forgot it
        waiting = sum(overview.counts[state] for state in WAITING)
        begun = sum(overview.counts[state] for state in ACTIVE)
        tasks: dict[int, TaskStatus] = {}
        for first in range(0, min(waiting, limit), PAGE):
            count = min(PAGE, waiting - first)
            page = await self._ask.page(system_id, first, count, begun=begun, known=tasks)
            tasks |= {task.id: task for task in page}
        return queue_status_of(overview, system_id, tuple(tasks.values())[:limit], current)

    async def history(
        self, *, vehicle: int | None = None, limit: int = 20
    ) -> tuple[TaskStatus, ...]:
        """Return up to ``limit`` finished tasks of a rover, newest first.

        ``ended_ago`` says when each ended. Raise Refused if the server is too old to list them.
        """
        system_id = self._which(vehicle)
        overview = await self._ask.overview(system_id)
        over = sum(overview.counts[state] for state in TERMINAL)
        tasks: dict[int, TaskStatus] = {}
        for first in range(0, min(over, limit), PAGE):
            size = min(PAGE, over - first)
            page = await self._ask.finished(system_id, first, size, known=tasks)
            if not page and not tasks:
                raise Refused(NO_HISTORY, result=MavResult.UNSUPPORTED, reason=TaskReason.NONE)
            tasks |= {task.id: task for task in page}
        return tuple(tasks.values())[:limit]

    async def stop(
        self, *, clear: bool = False, vehicle: int | None = None, within: float = STOP_WITHIN
    ) -> None:
        """Stop all rovers, or only ``vehicle``, at once; no task runs until ``resume``.

        This ignores the client's default rover, and needs no ``found``. ``clear`` also cancels the
        waiting tasks. STOP is sent ten times a second until it is answered, for ``within`` seconds,
        and then to each rover that is known, until each has answered.
        After Refused (VEHICLE_SILENT) it stays in force, and stops the rover once that is heard;
        after Refused (STORE_UNAVAILABLE) it is in force until the server restarts.
        """
        await self._stop(vehicle, clear=clear, within=within)
        rovers = self._open.session.fleet.served() if vehicle is None else []
        if len(rovers) > 1:  # several gateways may have them, and one has answered
            each = (self._stop(rover, clear=clear, within=within) for rover in rovers)
            for outcome in await asyncio.gather(*each, return_exceptions=True):
                if isinstance(outcome, BaseException):
                    raise outcome

    async def _stop(self, vehicle: int | None, *, clear: bool, within: float) -> None:
        command = self._stop_command(vehicle, clear=clear)
        try:
            await self._ask.ask(command, "STOP", within=within, again=STOP_AGAIN, is_urgent=True)
        except NoAnswer as error:
            fleet = self._open.session.fleet
            if fleet.served() or not fleet.is_listed:
                raise
            words = "the task server has heard no rover: there is nothing to stop"
            raise NoAnswer(words) from error
        except Refused as error:
            words = STOP_IN_FORCE.get(error.reason, str(error))
            raise Refused(words, result=error.result, reason=error.reason) from error

    def stop_again(self, *, clear: bool = False, vehicle: int | None = None) -> None:
        """Send one STOP and wait for no answer: an equal ``stop`` that is not sent yet gets it."""
        self._open.session.send(self._stop_command(vehicle, clear=clear))
        self._open.turn()

    def _stop_command(self, vehicle: int | None, *, clear: bool) -> m.CommandLong:
        """Return a STOP; what it has overtaken is not sent any more."""
        self._halts += 1
        self._ask.call_off(
            lambda other: (
                other.command == MavCmd.DO_PAUSE_CONTINUE
                and other.param1 == RESUME
                and vehicle in (None, 0, other.target_system)
            ),
            OVERTAKEN,
        )
        params = float(clear), 0, 0, 0, 0, 0, 0
        return m.CommandLong(vehicle or 0, 0, MavCmd.TASK_STOP, 0, *params)

    async def pause(self, *, vehicle: int | None = None) -> None:
        """Stop the rover; its task can continue from there."""
        self._halts += 1
        await self._control(vehicle, MavCmd.DO_PAUSE_CONTINUE, 0.0, is_urgent=True)

    async def resume(self, *, epoch: int | None = None, vehicle: int | None = None) -> None:
        """Resume after a pause, a STOP or a takeover. Raise Refused, with the reason, if blocked.

        ``epoch`` is the ``halt_epoch`` of the status that you have seen, None: the present one. If
        anything has halted the rover since then, raise Refused (STALE), however late this arrives.
        """
        seen = await self._seen(vehicle, epoch)
        await self._control(vehicle, MavCmd.DO_PAUSE_CONTINUE, RESUME, seen)

    @property
    def vehicle(self) -> int:
        """The default rover. Raise NoSuchVehicle if the server does not have it, or if there is no
        default and not exactly one rover.
        """
        return self._which(None)

    def shared_ids(self) -> list[int]:
        """Return the system ids that two rovers have: the server ignores the second of each."""
        return [
            number for number, is_shared in self._open.session.fleet.shared.items() if is_shared
        ]

    def vehicles(self) -> tuple[VehicleStatus, ...]:
        """Return the last known state of the server's rovers."""
        return self._open.session.vehicles(now=self._now)

    def some_vehicles(self, ids: Container[int]) -> tuple[VehicleStatus, ...]:
        """Return the last known state of the rovers with these ids."""
        return self._open.session.vehicles(only=ids, now=self._now)

    async def texts(self) -> AsyncIterator[Text]:
        """Yield each STATUSTEXT of rovers and task servers from now on."""
        with self._ask.hearing() as heard:
            while True:
                text = await heard.get()
                if text is None:
                    raise ClientError("the client was closed")
                yield text

    @contextmanager
    def listening(self, listener: Callable[[News], None]) -> Iterator[None]:
        """Call ``listener`` with each piece of news of any rover while this is open.

        The client calls it from the event loop: it must return at once, and not raise.
        """
        with self._ask.listening(listener):
            yield

    # plans

    async def submit_mission(self, plan: Plan, *, check: int = 0, **terms: Unpack[Terms]) -> Task:
        """Queue a mission as one task: a .plan or QGC WPL 110 file, or goals.

        Raise PlanFileError if a file is invalid. ``check``, up to 2,147,483,646: if you derive the
        nonce from a longer key, more bits of that; the server refuses a mission that repeats a
        nonce with another ``check``. ``terms`` as in ``submit``.
        """
        wire.check_check(check)
        return await self._submit(plan, None, check=check, **terms)

    async def stage_mission(self, plan: Plan, *, vehicle: int | None = None) -> Task:
        """Stage a mission: upload it to the autopilot's address, to wait for ``start_mission``.

        It replaces the mission staged before.
        """
        system_id = self._which(vehicle)
        items = items_of(plan)
        if self._has_home_item(system_id):
            items = wire.with_home(items)
        return await self._submit_plan(items, Address(system_id, AUTOPILOT), None)

    async def start_mission(self, *, epoch: int | None = None, vehicle: int | None = None) -> Task:
        """Start the staged mission, or the last one again, as a new task.

        ``epoch`` as in ``resume``.
        """
        seen = await self._seen(vehicle, epoch)
        task_id = await self._control(vehicle, MavCmd.MISSION_START, 0.0, 0.0, seen)
        return await self.task(task_id, vehicle=self._which(vehicle))

    async def mission(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the staged mission, as it was uploaded."""
        return await self._ask.download(self._autopilot(vehicle), MavMissionType.MISSION)

    async def mission_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the staged mission for ``write_plan``; a home item becomes ``PlanFile.home``."""
        has_home_item = self._has_home_item(self._which(vehicle))
        items = wire.file_items(await self.mission(vehicle=vehicle))
        return plan_files.mission_of(items, has_home_item=has_home_item)

    async def fence_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the fence for ``write_plan``. Raise PlanFileError if a file cannot hold it."""
        return plan_files.fence_of(wire.file_items(await self.fence(vehicle=vehicle)))

    async def fence(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the items of the fence."""
        return await self._ask.download(self._autopilot(vehicle), MavMissionType.FENCE)

    async def set_fence(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the fence of a .plan file, which may be empty. Return the number of items."""
        items = wire.items_of_file(fence_items(file_of(plan)))
        await self._ask.upload(self._autopilot(vehicle), items, MavMissionType.FENCE)
        return len(items)

    async def rally_points(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the items of the rally points."""
        return await self._ask.download(self._autopilot(vehicle), MavMissionType.RALLY)

    async def set_rally_points(
        self, plan: PlanFile | Path | str, *, vehicle: int | None = None
    ) -> int:
        """Upload the rally points of a .plan file. Return their number."""
        items = wire.items_of_file(rally_items(file_of(plan)))
        await self._ask.upload(self._autopilot(vehicle), items, MavMissionType.RALLY)
        return len(items)

    # for handles

    def rearm(self) -> None:
        """Set the timer again: the listeners have changed."""
        if self._connection is not None:
            self._connection.turn()

    @contextmanager
    def streaming(self, vehicle: int, interval: float) -> Iterator[None]:
        """Stream the status of a rover's active task every ``interval`` s while this is open."""
        watch = self._open.session.watch
        wished = watch.open_stream(vehicle, interval)
        self._set_stream(vehicle, wished)
        try:
            yield
        finally:
            left = watch.close_stream(vehicle, interval)
            if self._connection is not None:
                self._set_stream(vehicle, left)

    # internal

    @property
    def _open(self) -> Connection:
        if self._connection is None:
            raise MavTasksError(f"{self!r}: open it first, by 'async with'")
        return self._connection

    @property
    def _ask(self) -> Asker:
        self._open  # noqa: B018  # raises if the client is closed
        assert self._asker is not None, "opened and closed with the connection"
        return self._asker

    @property
    def _now(self) -> float:
        return self._open.now

    def _which(self, vehicle: int | None) -> int:
        return self._open.session.fleet.which(self._vehicle if vehicle is None else vehicle)

    def _autopilot(self, vehicle: int | None) -> Address:
        return Address(self._which(vehicle), AUTOPILOT)

    def _has_home_item(self, vehicle: int) -> bool:
        """Return whether a rover's missions begin with home. Raise NoAnswer if not known."""
        view = self._open.session.fleet.get(vehicle)
        has_home_item = None if view is None else view.has_home_item
        if has_home_item is None:
            words = f"rover {vehicle} is silent: unknown whether its missions begin with home"
            raise NoAnswer(words)
        return has_home_item

    def _handle(self, followed: Followed) -> Task:
        task = self._tasks.get(followed)
        if task is None:
            task = self._tasks[followed] = Task(self, followed)
        return task

    async def _control(
        self,
        vehicle: int | None,
        command: MavCmd,
        *params: float,
        is_urgent: bool = False,
        fits: Callable[[m.CommandAck], bool] = lambda _ack: True,
    ) -> int:
        # A nonce in an unused parameter makes each call distinct. The server takes an equal command
        # within 2.5 s for a copy: without nonces, also a resume after a STOP for one before it.
        filled = (*params, *(0.0,) * (6 - len(params)), to_param(self._submissions.nonce()))
        message = m.CommandLong(self._which(vehicle), AUTOPILOT, command, 0, *filled)
        return await self._ask.ask(message, command.name, is_urgent=is_urgent, fits=fits)

    async def _seen(self, vehicle: int | None, epoch: int | None) -> float:
        """Return the command parameter for an epoch; None: the present one.

        The server takes 0 for "no epoch", and does not compare it. Raise ClientError if this
        client requests a STOP or a pause meanwhile.
        """
        if epoch is None:
            halts = self._halts
            epoch = (await self._ask.overview(self._which(vehicle))).halt_epoch
            if halts != self._halts:
                raise ClientError(OVERTAKEN)
        elif epoch and epoch % EPOCHS == 0:
            raise ValueError(f"epoch {epoch} would be sent as none: read the queue again")
        return float(epoch % EPOCHS)

    async def _cancel(
        self, task_id: int | None, how: float, vehicle: int | None, *, series: bool = False
    ) -> int:
        if task_id is None:  # look up its id: a repeated command must not cancel the next task
            task_id = (await self._ask.overview(self._which(vehicle))).running_id
            if not task_id:
                words = "no task is running"
                raise Refused(words, result=MavResult.DENIED, reason=TaskReason.NOT_FOUND)
        named = task_id
        return await self._control(
            vehicle,
            MavCmd.TASK_CANCEL,
            to_param(task_id),
            how,
            float(series),
            is_urgent=how == KILL,
            fits=lambda ack: series or ack.result_param2 == named,
        )

    async def _set_repeat(self, task_id: int, repeat: str, *, vehicle: int | None) -> None:
        if not repeat or repeat.isdigit():
            params = to_param(task_id), float(TaskProperty.EVERY), float(repeat or 0)
            await self._control(vehicle, MavCmd.TASK_MODIFY, *params)
            return
        await self._write(
            task_id, TaskProperty.REPEAT, repeat, lambda status: status.every, vehicle=vehicle
        )

    async def _write(
        self,
        task_id: int,
        name: TaskProperty,
        text: str,
        shown: Callable[[TaskStatus], object],
        *,
        vehicle: int | None,
    ) -> None:
        """Send a text of a task, piece after piece.

        The acks of two pieces look the same. So look at the task afterwards, and if its text is
        another one, send them again with a rest after each, in which late acks run out. Raise
        NoAnswer if it is another one even then.
        """
        size = float(len(text)) if name is TaskProperty.REPEAT else nan
        for is_told_apart in (True, False):
            try:
                for piece in text_pieces(text):
                    await self._modify_exactly(
                        *(task_id, name, piece.x, piece.y, float(piece.offset)),
                        size=size,
                        is_told_apart=is_told_apart,
                        vehicle=vehicle,
                    )
            except Refused as refused:  # perhaps because a piece before this one was lost
                if refused.reason != TaskReason.BAD_PARAMETER or not is_told_apart:
                    raise
            else:
                if shown(await self.status(task_id, vehicle=vehicle)) == text:
                    return
        raise NoAnswer(
            f"task {task_id}: its {name.name.lower()} did not arrive whole: set it again"
        )

    async def _modify_exactly(
        self,
        task_id: int,
        name: TaskProperty,
        x: int,
        y: int,
        value: float,
        *,
        size: float = nan,
        is_told_apart: bool = False,
        vehicle: int | None,
    ) -> None:
        """Change a property whose value a float32 cannot hold exactly."""
        system_id, mark = self._which(vehicle), to_param(self._submissions.nonce())
        first = to_param(task_id), float(name), value, size
        command = m.CommandInt(
            system_id, AUTOPILOT, 0, MavCmd.TASK_MODIFY, 0, 0, *first, x, y, mark
        )
        await self._ask.ask(command, "TASK_MODIFY", is_told_apart=is_told_apart)

    # submitting

    async def _submit(
        self,
        plan: Plan,
        command: Move | Rotate | Drive | None,
        *,
        vehicle: int | AnyRover | None = None,
        nonce: int = 0,
        check: int = 0,
        **terms: Unpack[CommonTerms],
    ) -> Task:
        """Submit a plan; ``command``: its only goal, if that is sent as a command."""
        rest = given(terms, OF_NEW)
        check_label(rest.get("label", ""))
        delay, at = rest.pop("delay", 0.0), rest.get("at")
        repeat = _repeat_of(rest.pop("every", 0.0), delay, at)
        target = self._task_server(vehicle)
        mark = self._submissions.nonce(nonce)
        wait = UNTIL_REPEATED if _is_cron(repeat) else self._submissions.delay(delay, at, mark)
        # of a task that repeats, it is counted from each start, and set afterwards
        within = 0.0 if repeat else rest.get("deadline", 0.0)
        first = rest.pop("priority", DEFAULT_PRIORITY), id_of(rest.pop("after", 0))
        options = TaskOptions(*first, wait, within)
        if command is not None:
            task = await self._submit_command(command, options, target, mark)
        else:
            items = (*items_of(plan), wire.options_of(options, nonce=mark, check=check))
            task = await self._submit_plan(items, target, mark)
            if within:
                del rest["deadline"]  # which its options carried
        for name in ("deadline", "label"):
            if not rest.get(name):
                rest.pop(name, None)  # as a new task is
        await self._complete(task, repeat, rest, nonce=mark)
        return task

    async def _submit_command(
        self,
        goal: Move | Rotate | Drive,
        terms: TaskOptions,
        target: Address,
        mark: int,
    ) -> Task:
        to = target if target == SERVER else Address(target.system_id, AUTOPILOT)
        message = wire.command_of(goal, terms, target=to, nonce=mark)
        task_id = await self._ask.ask(
            message,
            "the task server" if target == SERVER else f"rover {target.system_id}",
            fits=lambda ack: (
                not self._submissions.is_anothers(ack.result_param2, mark, now=self._now)
            ),
            nonce=mark,
            is_told_apart=True,
        )
        return await self._submitted_to(target, task_id, mark)

    async def _submit_plan(
        self, items: tuple[Item, ...], target: Address, mark: int | None
    ) -> Task:
        task_id = await self._ask.upload(target, items, MavMissionType.MISSION, nonce=mark or 0)
        return await self._submitted_to(target, task_id, mark or 0)

    async def _submitted_to(self, target: Address, task_id: int, nonce: int) -> Task:
        if target != SERVER:
            return self._submitted_as(task_id, target.system_id, nonce)
        self._submissions.note(task_id, nonce, now=self._now)
        return self._submitted_as(task_id, await self._rover_of(task_id, nonce), nonce)

    async def _rover_of(self, task_id: int, nonce: int) -> int:
        """Return the rover that the server, or another gateway of its fleet, chose for a task."""
        for each in (SERVER.system_id, *self._open.session.fleet.served()):
            try:
                return (await self._ask.status(task_id, each)).vehicle
            except Refused as refused:
                if refused.reason != TaskReason.NOT_FOUND:
                    raise
        words = f"task {task_id} is stored, but no gateway shows it yet: submit it again"
        raise NoAnswer(words, nonce=nonce)

    def _task_server(self, vehicle: int | AnyRover | None) -> Address:
        """Return where a rover's tasks are submitted."""
        if vehicle == "any":
            return SERVER
        system_id = self._which(vehicle)
        view = self._open.session.fleet.get(system_id)
        assert view is not None, "it was looked up by its server"
        assert view.server_component is not None, "the same"
        return Address(system_id, view.server_component)

    async def _complete(self, task: Task, repeat: str, rest: dict[str, Any], *, nonce: int) -> None:
        """Set the terms that the submission could not carry."""
        try:
            if repeat:
                await self._repeat(task, repeat)
            if "at" in rest:
                await task.modify(at=rest.pop("at"))
            for name, value in rest.items():
                with _in_any_state():  # it may have started in time, or ended, already
                    await task.modify(**{name: value})
        except NoAnswer as error:  # the task exists: a second try needs its nonce
            raise NoAnswer(str(error), nonce=nonce) from None

    async def _repeat(self, task: Task, repeat: str) -> None:
        """Let a new task repeat. If the server refuses that, cancel the task."""
        try:
            await self._set_repeat(task.id, repeat, vehicle=task.vehicle)
        except Refused as refused:
            if refused.reason == TaskReason.WRONG_STATE and (await task.refresh()).series:
                return  # submitted before: its first run has ended
            with suppress(Refused):
                await task.cancel()
            raise

    def _submitted_as(self, task_id: int, vehicle: int, nonce: int) -> Task:
        self._submissions.note(task_id, nonce, now=self._now)
        session = self._open.session
        followed = session.follow(task_id, vehicle, nonce=nonce, now=self._now)
        session.watch.shed(self._tasks.__contains__)
        if followed.status is None:
            session.ask_about(followed, now=self._now)  # its changes are sent from now on
            self.rearm()
        return self._handle(followed)

    def _set_stream(self, vehicle: int, interval: float | None) -> None:
        self._open.session.set_stream(vehicle, interval, now=self._now)
        self.rearm()

    # session callbacks

    def _on_news(self, followed: Followed) -> None:
        task = self._tasks.get(followed)
        if task is not None:
            task.wake()


@contextmanager
def _in_any_state() -> Iterator[None]:
    try:
        yield
    except Refused as refused:
        if refused.reason != TaskReason.WRONG_STATE:
            raise


def _repeat_of(every: float | str, delay: float, at: datetime | None) -> str:
    """Return the text of a repetition, "" for none. Raise ValueError if it is invalid."""
    repeat = wire.repeat_of(every)
    if _is_cron(repeat) and (delay or at is not None):
        raise ValueError(f"every {every!r}: an expression names the start times, without delay, at")
    return repeat


def _is_cron(repeat: str) -> bool:
    return bool(repeat) and not repeat.isdigit()
