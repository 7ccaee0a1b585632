"""The journal's vocabulary: what happened, as frozen values.

Tasks are what these events add up to. ``at`` is monotonic seconds; wall-clock stamps are added
where events are stored or logged. ``actor`` is a client, or "server".
"""

from dataclasses import dataclass

from mav_tasks.tasks.goal import describe
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of
from mav_tasks.tasks.server_events import ParameterSet, SignatureRefused, SignaturesSeen
from mav_tasks.tasks.task import Frame, Progress, Task, TaskId, Terms
from mav_tasks.tasks.timing import Timing

SERVER = "server"


@dataclass(frozen=True, slots=True)
class TaskSubmitted:
    """A task was accepted; it is acknowledged once this event is durable."""

    task: Task
    at: float

    def __str__(self) -> str:
        task = self.task
        return (
            f"rover {task.vehicle}: task {task.id}: {describe(task.goal)}, "
            f"priority {task.priority}, from {task.submitter}"
        )


@dataclass(frozen=True, slots=True)
class TaskChanged:
    """A task moved along one edge of the lifecycle table.

    ``timing`` is that of its setpoints so far; it says something new where ``old`` is EXECUTING.
    """

    task_id: TaskId
    vehicle: int
    version: int
    old: TaskState
    new: TaskState
    reason: TaskReason
    actor: str
    at: float
    progress: Progress
    timing: Timing | None = None

    def __str__(self) -> str:
        why = f": {words_of(self.reason)}" if self.reason else ""
        who = "" if self.actor == SERVER else f", by {self.actor}"
        driven = f"; {self.timing}" if self.timing and self.old is TaskState.EXECUTING else ""
        return (
            f"rover {self.vehicle}: task {self.task_id} {self.new.name.lower()}{why}{who}{driven}"
        )


@dataclass(frozen=True, slots=True)
class TaskAdvanced:
    """A task being executed has begun its next leg; not a move in the lifecycle table."""

    task_id: TaskId
    vehicle: int
    version: int
    progress: Progress
    at: float
    item: int = 0  # its number in the plan's file, from 1

    def __str__(self) -> str:
        item = f"item {self.item}, " if self.item > 0 else ""
        return f"rover {self.vehicle}: task {self.task_id}: {item}leg {self.progress.leg + 1} begun"


@dataclass(frozen=True, slots=True)
class TaskProgressed:
    """How far a task has come that is being driven: kept for a crash, and no part of the journal.

    Only the last one of a task is kept. ``version`` is the task's, which this does not change.
    """

    task_id: TaskId
    vehicle: int
    version: int
    progress: Progress
    at: float

    def __str__(self) -> str:
        driven = f"{self.progress.execution_time:.0f} s driven"
        return f"rover {self.vehicle}: task {self.task_id}: {driven}"


@dataclass(frozen=True, slots=True)
class StepReached:
    """A step of a plan is done; ``performs``: it is a command that the vehicle gets now."""

    task_id: TaskId
    vehicle: int
    step: int
    performs: bool
    at: float
    item: int = 0  # its number in the plan's file, from 1; 0: home

    def __str__(self) -> str:
        item = f"item {self.item}" if self.item > 0 else "home"
        done = "sent" if self.performs else "reached"
        return f"rover {self.vehicle}: task {self.task_id}: {item} {done}"


@dataclass(frozen=True, slots=True)
class PlanStored:
    """A vehicle has another mission (``kind`` 0), fence (1) or rally points (2).

    ``plan_id`` names it to clients: a mission's is the id of the task that is made of it; 0 and no
    ``source``: it has none any more. ``source`` is the items as they came.
    """

    vehicle: int
    kind: int
    plan_id: int
    source: str
    actor: str
    at: float

    def __str__(self) -> str:
        what = ("mission", "fence", "rally points")[self.kind]
        return f"rover {self.vehicle}: {what} {self.plan_id or 'cleared'}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class TaskModified:
    """The terms of a task were changed."""

    task_id: TaskId
    vehicle: int
    version: int
    terms: Terms
    actor: str
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: task {self.task_id} modified, by {self.actor}"


@dataclass(frozen=True, slots=True)
class TaskWaits:
    """The next task of a vehicle cannot begin, for a reason that was not there before.

    ``words`` are the vehicle's own about it, "" if there are none.
    """

    task_id: TaskId
    vehicle: int
    reason: TaskReason
    at: float
    words: str = ""

    def __str__(self) -> str:
        words = f": {self.words}" if self.words else ""
        return f"rover {self.vehicle}: task {self.task_id} waits: {words_of(self.reason)}{words}"


@dataclass(frozen=True, slots=True)
class TaskWithdrawn:
    """A submission that did not become durable in time and was refused: it never was a task."""

    task_id: TaskId
    vehicle: int
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: task {self.task_id} withdrawn: not stored in time"


@dataclass(frozen=True, slots=True)
class SubmissionRefused:
    """A submission or request refused, for the audit log.

    ``command`` is 0 of an upload of a plan, and of another message minus its id.
    """

    vehicle: int
    command: int
    reason: TaskReason
    text: str
    actor: str
    at: float

    def __str__(self) -> str:
        what = f"command {self.command}" if self.command > 0 else f"message {-self.command}"
        what = what if self.command else "upload"
        rover = f"rover {self.vehicle}: " if self.vehicle else ""
        return f"{rover}{what} of {self.actor} refused: {self.text}"


@dataclass(frozen=True, slots=True)
class QueuePaused:
    """A vehicle's queue stands; STOPPED is the STOP latch."""

    vehicle: int
    reason: TaskReason
    actor: str
    at: float

    def __str__(self) -> str:
        if self.reason is TaskReason.STOPPED:
            return f"rover {self.vehicle}: STOP by {self.actor}, nothing runs until continued"
        return f"rover {self.vehicle}: queue paused: {words_of(self.reason)}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class QueueContinued:
    """A vehicle's queue goes on."""

    vehicle: int
    actor: str
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: queue continued by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleHalted:
    """Something made a vehicle stand, or would have: ``epoch`` counts these.

    What lets it go on has to be newer than the last one.
    """

    vehicle: int
    epoch: int
    reason: TaskReason
    actor: str
    at: float

    def __str__(self) -> str:
        words = f"rover {self.vehicle}: halt {self.epoch}, {words_of(self.reason)}"
        return words if self.actor == SERVER else f"{words}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleIdentified:
    """The vehicle behind a system id has told its unique id (AUTOPILOT_VERSION)."""

    vehicle: int
    uid: str
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: its unique id is {self.uid}"


@dataclass(frozen=True, slots=True)
class VehicleHomeSet:
    """Where a vehicle returns to: where it was first armed since it booted, or what a client set.

    ``frame`` is that of the vehicle at that time: after another boot it has another home.
    """

    vehicle: int
    latitude_degE7: int
    longitude_degE7: int
    frame: Frame
    actor: str
    at: float

    def __str__(self) -> str:
        place = f"{self.latitude_degE7 / 1e7:.7f}, {self.longitude_degE7 / 1e7:.7f}"
        who = "first armed there" if self.actor == SERVER else f"by {self.actor}"
        return f"rover {self.vehicle}: its home is {place}, {who}"


@dataclass(frozen=True, slots=True)
class VehicleArmingSet:
    """Whether the server may arm it, as far as that is a person's word: who disarms says no."""

    vehicle: int
    may_arm: bool
    at: float

    def __str__(self) -> str:
        words = "may be armed again" if self.may_arm else "is armed only after a continue"
        return f"rover {self.vehicle} {words}"


@dataclass(frozen=True, slots=True)
class VehicleSpeedSet:
    """The speed of tasks that name none was changed; None: as in the settings."""

    vehicle: int
    speed: float | None
    actor: str
    at: float

    def __str__(self) -> str:
        speed = "as configured" if self.speed is None else f"{self.speed:g} m/s"
        return f"rover {self.vehicle}: default speed {speed}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleSeen:
    """A vehicle was found, is heard again, or has said something that is as it should be."""

    vehicle: int
    text: str
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: {self.text}"


@dataclass(frozen=True, slots=True)
class VehicleNoted:
    """Something about a vehicle that its operator should read: silent, taken over, restarted."""

    vehicle: int
    text: str
    at: float

    def __str__(self) -> str:
        return f"rover {self.vehicle}: {self.text}"


@dataclass(frozen=True, slots=True)
class ServerStopped:
    """The orderly end: every vehicle stands in HOLD, or the time allowed for it is over.

    ``unconfirmed`` are the vehicles that had been told, but were not seen to stand in HOLD yet.
    """

    unconfirmed: tuple[int, ...]
    at: float

    def __str__(self) -> str:
        if not self.unconfirmed:
            return "server stopped: no rover is being driven"
        names = ", ".join(map(str, self.unconfirmed))
        return f"server stopped: rover {names} told to stop, not yet seen standing in HOLD"


Event = (
    TaskSubmitted
    | TaskChanged
    | TaskAdvanced
    | TaskProgressed
    | StepReached
    | PlanStored
    | TaskModified
    | TaskWaits
    | TaskWithdrawn
    | SubmissionRefused
    | QueuePaused
    | QueueContinued
    | VehicleHalted
    | VehicleIdentified
    | VehicleArmingSet
    | VehicleSpeedSet
    | VehicleHomeSet
    | ParameterSet
    | SignaturesSeen
    | SignatureRefused
    | VehicleSeen
    | VehicleNoted
    | ServerStopped
)
