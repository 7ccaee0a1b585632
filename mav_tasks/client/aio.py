"""The client library for asyncio. No polling: what the server tells wakes who waits for it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from math import nan
from pathlib import Path
from types import TracebackType
from typing import Self
from weakref import WeakValueDictionary

from mav_tasks import plan_files
from mav_tasks.client import wire
from mav_tasks.client.asker import Asker
from mav_tasks.client.connection import Connection
from mav_tasks.client.handle import Release, Task
from mav_tasks.client.plan_sources import Plan, file_of, items_of
from mav_tasks.client.session import Session
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.client.submissions import Submissions, utc_of
from mav_tasks.client.values import (
    QueueStatus,
    TaskStatus,
    TaskTiming,
    Text,
    VehicleStatus,
    queue_status_of,
)
from mav_tasks.client.watch import Followed
from mav_tasks.client.wire import Goal, TaskOptions
from mav_tasks.errors import ClientError, MavTasksError, NoAnswer, Refused
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
from mav_tasks.mavlink.label import check_label, pieces_of
from mav_tasks.mavlink.signing import Key
from mav_tasks.plan_files import (
    PlanFile,
    fence_items,
    rally_items,
)
from mav_tasks.services.mission_item import Item
from mav_tasks.tasks.goal import Drive, Move, Rotate
from mav_tasks.tasks.lifecycle import ACTIVE, TERMINAL, WAITING, TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY

DEFAULT_LINK = "udpout:127.0.0.1:14560"
#: not a ground station's (255), so that two on one link are told apart
SCRIPT = Address(244, 190)
FIND_WITHIN = 5.0  # s
STOP_AGAIN = 0.1  # s
STOP_WITHIN = 3.0  # s
KILL = 1.0  # param2 of TASK_CANCEL
RESUME = 1.0  # param1 of DO_PAUSE_CONTINUE
EPOCHS = 1 << 24  # that a float32 tells apart
PAGE = 16  # tasks that one request shows
NO_HISTORY = "the server does not list finished tasks: it is older than this client"
OVERTAKEN = "a STOP has overtaken this: ask for it again if it is still meant"
RELEASES: dict[Release, float] = {"again": 0.0, "remainder": 1.0, "skip": 2.0}


class Client:
    """A connection to a task server, and through it to its rovers.

    ``link`` is the server's, as a URL (``udpout:host:port``, ``tcp:host:port``,
    ``serial:device:baud``, ``udpin:host:port`` where the server pushes) or an open Link.
    ``vehicle`` is the system id of the rover that is meant where none is named; it can be left out
    where there is only one. ``timeout`` in seconds: until a server and a rover are found.

    With a ``key``, of 32 bytes, all that is sent is signed (MAVLink 2), and nothing is believed
    that the server has not signed with it. ``link_id`` 0 to 255 goes into the signatures; by chance
    if it is None. ValueError if the key is none.

    Every method may raise NoAnswer, Refused and NoSuchVehicle. All of it belongs to the loop on
    which it was opened.
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
    ) -> None:
        self._link = link
        self._signatures = None if key is None else ClientSignatures(key, link_id=link_id)
        self._vehicle = vehicle
        self._timeout = timeout
        self._address = Address(system_id, component_id)
        self._connection: Connection | None = None
        self._asker: Asker | None = None
        self._served = asyncio.Event()
        self._tasks: WeakValueDictionary[Followed, Task] = WeakValueDictionary()
        self._submissions = Submissions()
        self._halts = 0  # STOPs and pauses that were asked for here

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

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    def open(self) -> None:
        """Open the link, and wait for nothing. LinkUrlError, LinkOpenError."""
        if self._connection is not None:
            raise MavTasksError(f"{self!r}: it is open already")
        connection = Connection(
            self._link,
            lambda now: Session(self._address, now=now),
            signatures=self._signatures,
        )
        session = connection.session
        session.on_served = self._served.set
        session.on_news = self._on_news
        self._connection, self._asker = connection, Asker(connection)

    async def found(self) -> None:
        """Wait until a task server has answered, of each rover that is heard."""
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
            if self._signatures is not None and not session.fleet.served():
                words = f"{words} And: {self._signatures.why_silent()}"
            raise NoAnswer(words) from None

    async def close(self) -> None:
        """Close the link. Tasks go on: the server has them."""
        connection, self._connection = self._connection, None
        asker, self._asker = self._asker, None
        if connection is not None:
            connection.close()
        if asker is not None:
            asker.close()
        for task in list(self._tasks.values()):
            task.close()
        self._served.set()  # for who still waits to find one

    # tasks

    async def submit(
        self,
        goal: Goal | Sequence[Goal],
        *,
        priority: int = DEFAULT_PRIORITY,
        after: int | Task = 0,
        delay: float = 0.0,
        deadline: float = 0.0,
        at: datetime | None = None,
        vehicle: int | None = None,
        nonce: int = 0,
        label: str = "",
    ) -> Task:
        """Have a goal driven, or several in their order as one task; returns once it is durable.

        ``priority`` 0 to 10, 10 runs first. ``after`` names a task that must complete first.
        ``delay`` in seconds is waited before it runs, ``deadline`` in seconds is when it must have
        begun (0: neither); ``at`` is a start at a time of day, with its time zone. It is sent until
        it is answered, and is one task however often it arrives: ``nonce`` (1 to 1,065,353,215, 0:
        one by chance) is its mark, for a second try after NoAnswer. ``label`` is a name of up to 24
        bytes, shown wherever the task is.
        """
        check_label(label)
        system_id = self._which(vehicle)
        mark = self._submissions.nonce(nonce)
        wait = self._submissions.delay(delay, at, mark)
        terms = TaskOptions(priority, _id_of(after), wait, deadline)
        goals = goal if isinstance(goal, Sequence) and not isinstance(goal, str) else (goal,)
        if not goals:
            raise ValueError("no goals: nothing to do")
        if len(goals) == 1 and isinstance(goals[0], Move | Rotate | Drive):
            task = await self._submit_command(goals[0], terms, system_id, mark)
            await self._complete(task, deadline=deadline, at=at, label=label, nonce=mark)
        else:
            items = (*wire.items_of_goals(goals), wire.options_of(terms, nonce=mark))
            task = await self._submit_plan(items, system_id, mark)
            await self._complete(task, deadline=0.0, at=at, label=label, nonce=mark)
        return task

    async def task(self, task_id: int, *, vehicle: int | None = None) -> Task:
        """Return the handle of a task that is there, whoever submitted it. Refused (NOT_FOUND)."""
        system_id = self._which(vehicle)
        followed = self._open.session.follow(task_id, system_id, nonce=None, now=self._now)
        task = self._handle(followed)
        await self.status(task_id, vehicle=system_id)
        return task

    async def status(self, task_id: int, *, vehicle: int | None = None) -> TaskStatus:
        """Ask how a task is. Refused (NOT_FOUND) if there is none of this id."""
        return await self._ask.status(task_id, self._which(vehicle))

    async def timing(self, task_id: int | None = None, *, vehicle: int | None = None) -> TaskTiming:
        """Ask how evenly the setpoints of a task left, or those of the running one.

        Refused (NOT_FOUND) if there is none of this id, or none runs.
        """
        return await self._ask.timing(task_id or 0, self._which(vehicle))

    async def cancel(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """Call a task off, or the running one; gives its id. Refused if there is none."""
        return await self._cancel(task_id, 0.0, vehicle)

    async def kill(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """The same, and the rover is put into HOLD at once."""
        return await self._cancel(task_id, KILL, vehicle)

    async def clear(self, *, running_too: bool = False, vehicle: int | None = None) -> None:
        """Call off every task that waits, or all of them."""
        await self._control(vehicle, MavCmd.TASK_CLEAR, 1.0 if running_too else 0.0)

    async def modify(
        self,
        task_id: int,
        *,
        priority: int | None = None,
        delay: float | None = None,
        deadline: float | None = None,
        after: int | Task | None = None,
        preemptible: bool | None = None,
        preemptive: bool | None = None,
        at: datetime | None = None,
        label: str | None = None,
        vehicle: int | None = None,
    ) -> None:
        """Change a task that is not over; what is None stays as it is.

        Times in seconds from now. ``preemptible``: others may interrupt it; ``preemptive``: it may
        interrupt others.
        """
        changes: list[tuple[TaskProperty, float]] = []
        named: tuple[tuple[TaskProperty, float | None], ...] = (
            (TaskProperty.PRIORITY, priority),
            (TaskProperty.DEADLINE, deadline),
            (TaskProperty.RUN_AFTER, None if after is None else to_param(_id_of(after))),
            (TaskProperty.PREEMPTIBLE, preemptible),
            (TaskProperty.PREEMPTIVE, preemptive),
            (TaskProperty.START_DELAY, delay),
        )
        changes += [(name, float(value)) for name, value in named if value is not None]
        for name, value in changes:
            await self._control(vehicle, MavCmd.TASK_MODIFY, to_param(task_id), float(name), value)
        if at is not None:
            await self._start_at(task_id, at, self._which(vehicle))
        for piece in pieces_of(label) if label is not None else ():
            await self._modify_exactly(
                task_id, TaskProperty.LABEL, piece.x, piece.y, float(piece.offset), vehicle=vehicle
            )

    async def release(
        self,
        task_id: int | None,
        how: Release,
        *,
        epoch: int | None = None,
        vehicle: int | None = None,
    ) -> int:
        """Decide about a held task, None: the held one; gives its id. ``epoch`` as of ``resume``.

        While the queue is paused the task goes on when that is resumed.
        """
        if how not in RELEASES:
            raise ValueError(f"{how!r}: expected one of {', '.join(RELEASES)}")
        seen = await self._seen(vehicle, epoch)
        params = to_param(task_id or 0), RELEASES[how], seen
        return await self._control(vehicle, MavCmd.TASK_RELEASE, *params)

    # the queue and the rovers

    async def queue(self, *, vehicle: int | None = None, limit: int = 100) -> QueueStatus:
        """Ask what a rover does and what waits, of that up to ``limit`` tasks."""
        system_id = self._which(vehicle)
        overview = await self._ask.overview(system_id)
        running = overview.running_id
        current = None
        if running:
            try:
                current = await self.status(running, vehicle=system_id)
            except Refused:
                current = None  # over, and forgotten, in between
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
        """Ask for the tasks of a rover that are over, newest first, up to ``limit``.

        ``ended_ago`` of each says when it ended. Raise Refused if the server is too old to list
        them.
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
        """Stop every rover, or the one named, at once; nothing runs until ``resume``.

        ``clear``: what waits is called off, too. It need not be found before: this is sent on any
        open link, ten times a second until it is answered, for ``within`` seconds. Refused
        (VEHICLE_SILENT) means that it stays in force, and reaches the rover when it is heard again.
        """
        self._halts += 1
        command = m.CommandLong(
            vehicle or 0, 0, MavCmd.TASK_STOP, 0, float(clear), 0, 0, 0, 0, 0, 0
        )
        self._ask.call_off(
            lambda other: (
                other.command == MavCmd.DO_PAUSE_CONTINUE
                and other.param1 == RESUME
                and vehicle in (None, 0, other.target_system)
            ),
            OVERTAKEN,
        )
        await self._ask.ask(command, "STOP", within=within, again=STOP_AGAIN, is_urgent=True)

    async def pause(self, *, vehicle: int | None = None) -> None:
        """Stop the rover where it is, so that its task can go on."""
        self._halts += 1
        await self._control(vehicle, MavCmd.DO_PAUSE_CONTINUE, 0.0, is_urgent=True)

    async def resume(self, *, epoch: int | None = None, vehicle: int | None = None) -> None:
        """Go on after a pause, a STOP or a takeover. Refused says what is in the way.

        ``epoch`` is the ``halt_epoch`` of the status that you have seen, None: of now. Whatever
        makes the rover stand after that is not undone: Refused (STALE), however long this took.
        """
        seen = await self._seen(vehicle, epoch)
        await self._control(vehicle, MavCmd.DO_PAUSE_CONTINUE, RESUME, seen)

    @property
    def vehicle(self) -> int:
        """The rover that is meant where a call names none. Raise NoSuchVehicle if it is not there,
        or if there are several and ``vehicle`` was not given.
        """
        return self._which(None)

    def vehicles(self) -> tuple[VehicleStatus, ...]:
        """Return the rovers of the server, as they were heard last."""
        return self._open.session.vehicles(now=self._now)

    async def texts(self) -> AsyncIterator[Text]:
        """Yield the texts that rovers and task servers say from now on."""
        with self._ask.hearing() as heard:
            while True:
                text = await heard.get()
                if text is None:
                    raise ClientError("the client was closed")
                yield text

    # plans

    async def submit_mission(
        self,
        plan: Plan,
        *,
        priority: int = DEFAULT_PRIORITY,
        after: int | Task = 0,
        delay: float = 0.0,
        deadline: float = 0.0,
        at: datetime | None = None,
        vehicle: int | None = None,
        nonce: int = 0,
        label: str = "",
    ) -> Task:
        """Queue a mission as one task: a .plan or QGC WPL 110 file, or goals.

        PlanFileError says what is wrong with a file. Terms as those of ``submit``.
        """
        check_label(label)
        system_id = self._which(vehicle)
        mark = self._submissions.nonce(nonce)
        wait = self._submissions.delay(delay, at, mark)
        terms = TaskOptions(priority, _id_of(after), wait, deadline)
        items = (*items_of(plan), wire.options_of(terms, nonce=mark))
        task = await self._submit_plan(items, system_id, mark)
        await self._complete(task, deadline=0.0, at=at, label=label, nonce=mark)
        return task

    async def stage_mission(self, plan: Plan, *, vehicle: int | None = None) -> Task:
        """Upload a mission to the autopilot's own place, where it waits until it is started.

        It takes the place of the one that waits there.
        """
        system_id = self._which(vehicle)
        items = items_of(plan)
        if self._has_home_item(system_id):
            items = wire.with_home(items)
        return await self._submit_plan(items, system_id, None, component=AUTOPILOT)

    async def start_mission(self, *, epoch: int | None = None, vehicle: int | None = None) -> Task:
        """Start the mission that waits there, or the last one again, as another task.

        ``epoch`` as of ``resume``.
        """
        seen = await self._seen(vehicle, epoch)
        task_id = await self._control(vehicle, MavCmd.MISSION_START, 0.0, 0.0, seen)
        return await self.task(task_id, vehicle=self._which(vehicle))

    async def mission(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Fetch the mission from the autopilot's place, as it was uploaded."""
        return await self._ask.download(self._autopilot(vehicle), MavMissionType.MISSION)

    async def mission_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Fetch the mission as ``write_plan`` takes it; home, if it came along, is apart."""
        has_home_item = self._has_home_item(self._which(vehicle))
        items = wire.file_items(await self.mission(vehicle=vehicle))
        return plan_files.mission_of(items, has_home_item=has_home_item)

    async def fence_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Fetch the fence as ``write_plan`` takes it. PlanFileError if a file cannot hold it."""
        return plan_files.fence_of(wire.file_items(await self.fence(vehicle=vehicle)))

    async def fence(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Fetch the fence."""
        return await self._ask.download(self._autopilot(vehicle), MavMissionType.FENCE)

    async def set_fence(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the fence of a .plan file, which may be empty; gives the number of its items."""
        items = wire.items_of_file(fence_items(file_of(plan)))
        await self._ask.upload(self._autopilot(vehicle), items, MavMissionType.FENCE)
        return len(items)

    async def set_rally_points(
        self, plan: PlanFile | Path | str, *, vehicle: int | None = None
    ) -> int:
        """Upload the rally points of a .plan file; gives their number."""
        items = wire.items_of_file(rally_items(file_of(plan)))
        await self._ask.upload(self._autopilot(vehicle), items, MavMissionType.RALLY)
        return len(items)

    # for handles

    def rearm(self) -> None:
        """What somebody waits for has changed: see to the timer."""
        if self._connection is not None:
            self._connection.turn()

    @contextmanager
    def streaming(self, vehicle: int, interval: float) -> Iterator[None]:
        """Have a rover's active task told each so many seconds, for as long as this is open."""
        watch = self._open.session.watch
        wished = watch.open_stream(vehicle, interval)
        self._set_stream(vehicle, wished)
        try:
            yield
        finally:
            left = watch.close_stream(vehicle, interval)
            if self._connection is not None:
                self._set_stream(vehicle, left)

    # inside

    @property
    def _open(self) -> Connection:
        if self._connection is None:
            raise MavTasksError(f"{self!r}: open it first, by 'async with'")
        return self._connection

    @property
    def _ask(self) -> Asker:
        self._open  # noqa: B018  # says so if it is not
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
        """Return whether the first item of a mission is home there. NoAnswer if nobody knows."""
        view = self._open.session.fleet.get(vehicle)
        if view is None or not view.is_known:
            words = f"rover {vehicle} is silent: whether its missions begin with home is not known"
            raise NoAnswer(words)
        return view.has_home_item

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
        # An unused parameter marks each call as one of its own: the server takes an equal command
        # that follows within 2.5 s for a copy, and so a resume before a STOP for the one after it.
        filled = (*params, *(0.0,) * (6 - len(params)), to_param(self._submissions.nonce()))
        message = m.CommandLong(self._which(vehicle), AUTOPILOT, command, 0, *filled)
        return await self._ask.ask(message, command.name, is_urgent=is_urgent, fits=fits)

    async def _seen(self, vehicle: int | None, epoch: int | None) -> float:
        """Return what names an epoch in a command; None: the present one.

        Raise ClientError if this client itself has asked for a STOP or a pause since.
        """
        if epoch is None:
            halts = self._halts
            epoch = (await self._ask.overview(self._which(vehicle))).halt_epoch
            if halts != self._halts:
                raise ClientError(OVERTAKEN)
        return float(epoch % EPOCHS)

    async def _cancel(self, task_id: int | None, how: float, vehicle: int | None) -> int:
        if task_id is None:  # by its id: a command that is repeated must not call off the next one
            task_id = (await self._ask.overview(self._which(vehicle))).running_id
            if not task_id:
                words = "no task is running"
                raise Refused(words, result=MavResult.DENIED, reason=TaskReason.NOT_FOUND)
        await self._control(
            vehicle,
            MavCmd.TASK_CANCEL,
            to_param(task_id),
            how,
            is_urgent=how == KILL,
            fits=lambda ack: ack.result_param2 == task_id,
        )
        return task_id

    async def _start_at(self, task_id: int, at: datetime, vehicle: int) -> None:
        moment = round(utc_of(at))
        await self._modify_exactly(task_id, TaskProperty.START_UTC, moment, 0, nan, vehicle=vehicle)

    async def _modify_exactly(
        self,
        task_id: int,
        name: TaskProperty,
        x: int,
        y: int,
        value: float,
        *,
        vehicle: int | None,
    ) -> None:
        """Change a property whose value a float cannot hold."""
        system_id, mark = self._which(vehicle), to_param(self._submissions.nonce())
        first = to_param(task_id), float(name), value, nan
        command = m.CommandInt(
            system_id, AUTOPILOT, 0, MavCmd.TASK_MODIFY, 0, 0, *first, x, y, mark
        )
        await self._ask.ask(command, "TASK_MODIFY")

    # submitting

    async def _submit_command(
        self,
        goal: Move | Rotate | Drive,
        terms: TaskOptions,
        vehicle: int,
        mark: int,
    ) -> Task:
        message = wire.command_of(goal, terms, target=(vehicle, AUTOPILOT), nonce=mark)
        task_id = await self._ask.ask(
            message,
            f"rover {vehicle}",
            fits=lambda ack: (
                not self._submissions.is_anothers(ack.result_param2, mark, now=self._now)
            ),
            nonce=mark,
            is_told_apart=True,
        )
        return self._submitted_as(task_id, vehicle, mark)

    async def _submit_plan(
        self,
        items: tuple[Item, ...],
        vehicle: int,
        mark: int | None,
        *,
        component: int | None = None,
    ) -> Task:
        view = self._open.session.fleet.get(vehicle)
        assert view is not None, "it was looked up by its server"
        assert view.server_component is not None, "the same"
        target = Address(vehicle, component or view.server_component)
        task_id = await self._ask.upload(target, items, MavMissionType.MISSION, nonce=mark or 0)
        return self._submitted_as(task_id, vehicle, mark or 0)

    async def _set_deadline(self, task: Task, deadline: float) -> None:
        try:
            await task.modify(deadline=deadline)
        except Refused as refused:
            if refused.reason != TaskReason.WRONG_STATE:
                raise  # else it is over already, and so has begun in time

    async def _set_label(self, task: Task, label: str) -> None:
        try:
            await task.modify(label=label)
        except Refused as refused:
            if refused.reason != TaskReason.WRONG_STATE:
                raise  # else it is over already

    async def _complete(
        self, task: Task, *, deadline: float, at: datetime | None, label: str, nonce: int
    ) -> None:
        """Return a task that is there what its submission could not carry."""
        try:
            if deadline:
                await self._set_deadline(task, deadline)
            if at is not None:
                await task.modify(at=at)
            if label:
                await self._set_label(task, label)
        except NoAnswer as error:  # the task is there: submitted again it must not be another one
            raise NoAnswer(str(error), nonce=nonce) from None

    def _submitted_as(self, task_id: int, vehicle: int, nonce: int) -> Task:
        self._submissions.note(task_id, nonce, now=self._now)
        session = self._open.session
        followed = session.follow(task_id, vehicle, nonce=nonce, now=self._now)
        session.watch.shed(self._tasks.__contains__)
        if followed.status is None:
            session.ask_about(followed, now=self._now)  # and have its changes told from now on
            self.rearm()
        return self._handle(followed)

    def _set_stream(self, vehicle: int, interval: float | None) -> None:
        self._open.session.set_stream(vehicle, interval, now=self._now)
        self.rearm()

    # what the session tells

    def _on_news(self, followed: Followed) -> None:
        task = self._tasks.get(followed)
        if task is not None:
            task.wake()


def _id_of(task: int | Task) -> int:
    return task.id if isinstance(task, Task) else task
