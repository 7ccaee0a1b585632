"""The tasks of all vehicles, connected or not, and their restoration after a restart.

Also how far a gateway signs ahead of its clock, which is a fence at the vehicle: all gateways of a
fleet sign to a vehicle with one link id. A vehicle refuses what is not later than the last packet
of that, so each gateway that gets it signs ahead of the one before.
"""

from collections.abc import Iterator

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.events import SERVER, QueuePaused
from mav_tasks.tasks.halts import WORDS, LastHalt
from mav_tasks.tasks.lifecycle import (
    ACTIVE,
    LOSSES,
    RUNNING,
    TAKEN,
    WAITING,
    TaskReason,
    TaskState,
)
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task, TaskId
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

#: s by which the lead grows with each takeover. The clocks of gateways may differ by that, less the
#: second from one heartbeat to the next
STEP = 3.0
#: s; a vehicle takes no stream that is new to it and a minute behind its time
MOST_LEAD = 50.0
#: s a second, by which a lead is reduced again
DECAY = 0.01


R, S = TaskReason, TaskState

#: s since a halt by command: enough for a supervisor to start this run and for it to find the
#: vehicle. Later, the vehicle may already follow a newer command that did not pass a server
UNSEEN = 15.0
LONG_IDLE = 600.0  # s without a write before the start: nobody remembers the queue


class Fleet:
    """``VehicleTasks`` by system id, and the pending tasks of all of them."""

    def __init__(self, registry: TaskRegistry, settings: Settings) -> None:
        self._registry = registry
        self._settings = settings
        self._of: dict[int, VehicleTasks] = {}
        #: return the tasks of a vehicle, None if nothing is known of it
        self.get = self._of.get
        self.room = PendingTasks(registry, settings)
        self._was_driven: set[int] = set()
        self._comes_up_paused = False
        self.began_at = 0.0  # start of this run, by the clock of ``now``

    def __iter__(self) -> Iterator[VehicleTasks]:
        return iter(self._of.values())

    def of(self, vehicle: int) -> VehicleTasks:
        """Return the tasks of a vehicle, which may have no tasks and may be unknown."""
        tasks = self._of.get(vehicle)
        if tasks is None:
            tasks = VehicleTasks(vehicle, self._registry, self.room, self._settings)
            self._of[vehicle] = tasks
            if self._comes_up_paused:
                tasks.restore((), Restored(), paused=R.RESTARTED, now=self.began_at)
                self._registry.record(QueuePaused(vehicle, R.RESTARTED, SERVER, self.began_at))
        return tasks

    def was_driven(self, vehicle: int) -> bool:
        """Return whether a task was driving a vehicle when the last run ended; True only once."""
        was_driven = vehicle in self._was_driven
        self._was_driven.discard(vehicle)
        return was_driven

    def last_halt(self, vehicle: int, *, now: float) -> LastHalt | None:
        """Return a vehicle's last halt if it was a command, and is younger than UNSEEN.

        A cancel or clear does not count while somebody else has the vehicle.
        """
        tasks = self.of(vehicle)
        halt, is_taken = tasks.halts.by_somebody, tasks.paused in TAKEN
        stops = WORDS - {R.CANCELLED, R.CLEARED} if is_taken else WORDS
        return halt if halt.reason in stops and now - halt.at <= UNSEEN else None

    def may_forget(self, vehicle: int, *, halted_before: float) -> bool:
        """Return whether no task of a vehicle runs, and no command has halted it just now.

        A halt may still have to come true if it was not given before ``halted_before``.
        """
        tasks = self.get(vehicle)
        if tasks is None:
            return True
        if tasks.halts.by_somebody.at > halted_before:
            return False
        active = tasks.active
        return active is None or active.state not in RUNNING

    def forget(self, vehicle: int, *, now: float) -> set[TaskId]:
        """Forget a vehicle and its tasks, which are stored; return the ids of these."""
        self._of.pop(vehicle, None)
        self._was_driven.discard(vehicle)
        return self.room.forget(vehicle, now=now)

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self.room.apply(settings)
        for tasks in self:
            tasks.apply(settings)

    def restore(self, restored: Restored, *, now: float) -> None:
        """Load an earlier run: hold the tasks that ran, pause queues that must not go on alone."""
        if restored.gateway:
            self._registry.ids.share()
            self.room.is_shared = True
        else:
            self._registry.ids.next = restored.next_id
        is_unclean = self._settings.on_restart == "pause" and not restored.ended_well
        self.began_at = now
        self._load(restored, is_unclean=is_unclean, now=now)
        self._comes_up_paused = is_unclean  # for vehicles found from now on

    def take_over(self, restored: Restored, *, now: float) -> None:
        """Load vehicles that this gateway has got: what waits goes on, also if another one failed.

        The task that ran, or that waited for a link or a lease, is held, or resumes by itself, as
        the settings say.
        """
        self._load(restored, is_unclean=False, is_elsewhere=True, now=now)

    def _load(
        self, restored: Restored, *, is_unclean: bool, is_elsewhere: bool = False, now: float
    ) -> None:
        """Load vehicles and their tasks. ``is_elsewhere``: another gateway had them."""
        self.room.set_wall_offset(restored.wall_offset, now=now)
        self._registry.restore(restored.tasks)
        of_note = {*restored.paused, *restored.speeds, *restored.uids, *restored.halt_epochs}
        begun: dict[int, list[Task]] = {each: [] for each in of_note | restored.disarmed}
        waiting: set[int] = set()
        goes_on: set[TaskId] = set()  # alone, or when its turn comes again
        for task in restored.tasks:
            is_lost = task.reason in LOSSES
            # one that stopped the vehicle at the end of its lease left it in our mode
            if task.state in RUNNING or (is_elsewhere and is_lost):
                self._was_driven.add(task.vehicle)
                task = self._interrupted(task, is_elsewhere=is_elsewhere, now=now)
                if task.state is S.PAUSED:
                    goes_on.add(task.id)
            elif task.state is S.PAUSED and is_elsewhere and task.reason is R.PREEMPTED:
                goes_on.add(task.id)
            elif task.state is S.PAUSED and not (
                is_lost or restored.ended_well or task.vehicle in restored.paused
            ):
                self._was_driven.add(task.vehicle)  # it was being taken, to resume this task
            if task.state in ACTIVE:
                begun.setdefault(task.vehicle, []).append(task)
            elif task.state in WAITING:
                waiting.add(task.vehicle)
        self.room.restore(restored.tasks, now=now)
        is_late = restored.idle > LONG_IDLE and self._settings.on_restart == "pause"
        for vehicle in sorted(waiting.union(begun)):
            tasks = begun.get(vehicle, [])
            paused = restored.paused.get(vehicle, R.NONE)
            has_paused = any(task.state is S.PAUSED and task.id not in goes_on for task in tasks)
            is_forgotten = is_late and (bool(tasks) or vehicle in waiting)
            if not paused and (has_paused or is_unclean or is_forgotten):
                paused = R.RESTARTED
                self._registry.record(QueuePaused(vehicle, paused, SERVER, now))
            self.of(vehicle).restore(tasks, restored, paused=paused, resuming=goes_on, now=now)

    def _interrupted(self, task: Task, *, is_elsewhere: bool, now: float) -> Task:
        """Hold a task that ran, or pause it if it is to resume by itself here."""
        resumes = is_elsewhere and self._settings.on_takeover == "resume"
        if not resumes or task.state is S.CANCELLING:
            state, reason = S.HELD, R.OUTCOME_UNKNOWN
        else:
            state, reason = S.PAUSED, R.LEASE_LOST
        if task.state is state:
            return task
        return self._registry.change(task.id, state, reason=reason, now=now)
