"""The blocking client: the calls of the asyncio client, each waiting for its answer.

Made by tools/generate: change aio.py, handle.py or blocking.py instead.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Unpack

from mav_tasks.client.aio import DEFAULT_LINK, FIND_WITHIN, SCRIPT, STOP_WITHIN, Client
from mav_tasks.client.blocking import BlockingClient, BlockingTask, Portal, called
from mav_tasks.client.handle import Release
from mav_tasks.client.plan_sources import Plan
from mav_tasks.client.session import TELEMETRY_RATE
from mav_tasks.client.terms import Changes, Terms
from mav_tasks.client.values import QueueStatus, TaskStatus, TaskTiming, Text, VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.engine.services.missions import Item
from mav_tasks.links.base import Link
from mav_tasks.mavlink.signing import Key
from mav_tasks.plans import PlanFile


class SyncTask(BlockingTask):
    """A handle of one task, valid while the client is open, even if the server restarts."""

    @property
    def id(self) -> int:
        """The task id. The server does not reuse it while the task can be queried."""
        return self._aio.id

    @property
    def vehicle(self) -> int:
        """The system id of its rover. A task for any rover may get another one before it begins."""
        return self._aio.vehicle

    @property
    def status(self) -> TaskStatus | None:
        """The last status received; None before the first."""
        return self._aio.status

    @property
    def series(self) -> int | None:
        """The id of the first run of its series; None: it is in none, or no status has come yet."""
        return self._aio.series

    def updates(self, *, interval: float = 0.5) -> Iterator[TaskStatus]:
        """Yield the status now, at each change, and every ``interval`` seconds while it is driven.

        The final status is the last one. A slow reader gets only the latest status.
        """
        return self._each(self._aio.updates(interval=interval))

    def refresh(self) -> TaskStatus:
        """Request and return the status. Raise Refused (NOT_FOUND) if the server lacks the task."""
        return self._call(self._aio.refresh())

    def timing(self) -> TaskTiming:
        """Return how evenly its setpoints have left so far; also works after the end."""
        return self._call(self._aio.timing())

    def cancel(self, *, series: bool = False) -> None:
        """Cancel the task; if it is being driven, the rover stops at once.

        ``done`` waits for standstill. ``series``: also all further runs of its series, if it
        repeats. Raise Refused if the task, or with ``series`` its series, has ended.
        """
        self._call(self._aio.cancel(series=series))

    def kill(self) -> None:
        """Cancel the task and put the rover into HOLD; no task starts until it stands still."""
        self._call(self._aio.kill())

    def modify(self, **changes: Unpack[Changes]) -> None:
        """Change the task: see ``SyncClient.modify``."""
        self._call(self._aio.modify(**changes))

    def release(self, how: Release) -> None:
        """Release the task: "again" restarts it here, "remainder" finishes it, "skip" drops it."""
        self._call(self._aio.release(how))


class SyncClient(BlockingClient):
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
        telemetry_rate: int = TELEMETRY_RATE,
        portal: Portal | None = None,
    ) -> None:
        super().__init__(
            lambda: Client(
                link,
                vehicle=vehicle,
                timeout=timeout,
                system_id=system_id,
                component_id=component_id,
                key=key,
                link_id=link_id,
                telemetry_rate=telemetry_rate,
            ),
            portal,
        )

    def open(self) -> None:
        """Open the link without waiting. Raise LinkUrlError or LinkOpenError if that fails."""
        self._begin()

    def found(self) -> None:
        """Wait until the task server of the default rover, or of each rover heard, has answered.

        Raise NoAnswer after ``timeout``; without a default rover only if none has answered.
        """
        self._call(self._aio.found())

    def close(self) -> None:
        """Close the link. The server continues the tasks."""
        self._end()

    def submit(self, goal: Goal | Sequence[Goal], **terms: Unpack[Terms]) -> SyncTask:
        """Submit a goal, or several goals in order as one task. Return once the task is durable.

        What ``terms`` there are, and mean, says ``mav_tasks.client.terms.Terms``.
        """
        return self._handle(SyncTask, self._aio.submit(goal, **terms))

    def task(self, task_id: int, *, vehicle: int | None = None) -> SyncTask:
        """Return the handle of any client's task. Raise Refused (NOT_FOUND) for an unknown id."""
        return self._handle(SyncTask, self._aio.task(task_id, vehicle=vehicle))

    def status(self, task_id: int, *, vehicle: int | None = None) -> TaskStatus:
        """Return the status of a task. Raise Refused (NOT_FOUND) if there is no task of this id."""
        return self._call(self._aio.status(task_id, vehicle=vehicle))

    def timing(self, task_id: int | None = None, *, vehicle: int | None = None) -> TaskTiming:
        """Return how evenly the setpoints of a task left; None: of the running task.

        Raise Refused (NOT_FOUND) if there is no task of this id, or no task is running.
        """
        return self._call(self._aio.timing(task_id, vehicle=vehicle))

    def parameter(self, name: str, *, vehicle: int | None = None) -> float:
        """Return a parameter of the server, such as TSK_SPEED.

        Raise NoAnswer if the server has no parameter of this name.
        """
        return self._call(self._aio.parameter(name, vehicle=vehicle))

    def cancel(
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
        return self._call(self._aio.cancel(task_id, series=series, kill=kill, vehicle=vehicle))

    def kill(self, task_id: int | None = None, *, vehicle: int | None = None) -> int:
        """Cancel a task and put the rover into HOLD at once. Return the task's id."""
        return self._call(self._aio.kill(task_id, vehicle=vehicle))

    def clear(self, *, running_too: bool = False, vehicle: int | None = None) -> None:
        """Cancel all waiting tasks; ``running_too``: the running one, too."""
        self._call(self._aio.clear(running_too=running_too, vehicle=vehicle))

    def modify(
        self, task_id: int, *, vehicle: int | None = None, **changes: Unpack[Changes]
    ) -> None:
        """Change a task that has not ended.

        What ``changes`` there are, and mean, says ``mav_tasks.client.terms.Changes``.
        """
        self._call(self._aio.modify(task_id, vehicle=vehicle, **changes))

    def release(
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
        return self._call(self._aio.release(task_id, how, epoch=epoch, vehicle=vehicle))

    def queue(self, *, vehicle: int | None = None, limit: int = 100) -> QueueStatus:
        """Return the running task of a rover and up to ``limit`` of its waiting tasks."""
        return self._call(self._aio.queue(vehicle=vehicle, limit=limit))

    def history(self, *, vehicle: int | None = None, limit: int = 20) -> tuple[TaskStatus, ...]:
        """Return up to ``limit`` finished tasks of a rover, newest first.

        ``ended_ago`` says when each ended. Raise Refused if the server is too old to list them.
        """
        return self._call(self._aio.history(vehicle=vehicle, limit=limit))

    def stop(
        self, *, clear: bool = False, vehicle: int | None = None, within: float = STOP_WITHIN
    ) -> None:
        """Stop all rovers, or only ``vehicle``, at once; no task runs until ``resume``.

        This ignores the client's default rover, and needs no ``found``. ``clear`` also cancels the
        waiting tasks. STOP is sent ten times a second until it is answered, for ``within`` seconds,
        and then to each rover that is known, until each has answered.
        After Refused (VEHICLE_SILENT) it stays in force, and stops the rover once that is heard;
        after Refused (STORE_UNAVAILABLE) it is in force until the server restarts.
        """
        self._call(self._aio.stop(clear=clear, vehicle=vehicle, within=within))

    def stop_again(self, *, clear: bool = False, vehicle: int | None = None) -> None:
        """Send one STOP and wait for no answer: an equal ``stop`` that is not sent yet gets it."""
        self._call(called(lambda: self._aio.stop_again(clear=clear, vehicle=vehicle)))

    def pause(self, *, vehicle: int | None = None) -> None:
        """Stop the rover; its task can continue from there."""
        self._call(self._aio.pause(vehicle=vehicle))

    def resume(self, *, epoch: int | None = None, vehicle: int | None = None) -> None:
        """Resume after a pause, a STOP or a takeover. Raise Refused, with the reason, if blocked.

        ``epoch`` is the ``halt_epoch`` of the status that you have seen, None: the present one. If
        anything has halted the rover since then, raise Refused (STALE), however late this arrives.
        """
        self._call(self._aio.resume(epoch=epoch, vehicle=vehicle))

    def shared_ids(self) -> list[int]:
        """Return the system ids that two rovers have: the server ignores the second of each."""
        return self._call(called(self._aio.shared_ids))

    def vehicles(self) -> tuple[VehicleStatus, ...]:
        """Return the last known state of the server's rovers."""
        return self._call(called(self._aio.vehicles))

    def texts(self) -> Iterator[Text]:
        """Yield each STATUSTEXT of rovers and task servers from now on."""
        return self._each(self._aio.texts())

    def submit_mission(self, plan: Plan, *, check: int = 0, **terms: Unpack[Terms]) -> SyncTask:
        """Queue a mission as one task: a .plan or QGC WPL 110 file, or goals.

        Raise PlanFileError if a file is invalid. ``check``, up to 2,147,483,646: if you derive the
        nonce from a longer key, more bits of that; the server refuses a mission that repeats a
        nonce with another ``check``. ``terms`` as in ``submit``.
        """
        return self._handle(SyncTask, self._aio.submit_mission(plan, check=check, **terms))

    def stage_mission(self, plan: Plan, *, vehicle: int | None = None) -> SyncTask:
        """Stage a mission: upload it to the autopilot's address, to wait for ``start_mission``.

        It replaces the mission staged before.
        """
        return self._handle(SyncTask, self._aio.stage_mission(plan, vehicle=vehicle))

    def start_mission(self, *, epoch: int | None = None, vehicle: int | None = None) -> SyncTask:
        """Start the staged mission, or the last one again, as a new task.

        ``epoch`` as in ``resume``.
        """
        return self._handle(SyncTask, self._aio.start_mission(epoch=epoch, vehicle=vehicle))

    def mission(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the staged mission, as it was uploaded."""
        return self._call(self._aio.mission(vehicle=vehicle))

    def mission_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the staged mission for ``write_plan``; a home item becomes ``PlanFile.home``."""
        return self._call(self._aio.mission_file(vehicle=vehicle))

    def fence_file(self, *, vehicle: int | None = None) -> PlanFile:
        """Return the fence for ``write_plan``. Raise PlanFileError if a file cannot hold it."""
        return self._call(self._aio.fence_file(vehicle=vehicle))

    def fence(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the items of the fence."""
        return self._call(self._aio.fence(vehicle=vehicle))

    def set_fence(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the fence of a .plan file, which may be empty. Return the number of items."""
        return self._call(self._aio.set_fence(plan, vehicle=vehicle))

    def rally_points(self, *, vehicle: int | None = None) -> tuple[Item, ...]:
        """Return the items of the rally points."""
        return self._call(self._aio.rally_points(vehicle=vehicle))

    def set_rally_points(self, plan: PlanFile | Path | str, *, vehicle: int | None = None) -> int:
        """Upload the rally points of a .plan file. Return their number."""
        return self._call(self._aio.set_rally_points(plan, vehicle=vehicle))
