"""The journal's vocabulary: what happened, as frozen values.

Tasks are what these events add up to. ``at`` is monotonic seconds; wall-clock stamps are added
where events are stored or logged. ``actor`` is a client, or "server".
"""

from dataclasses import dataclass

from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Progress, Task, TaskId

SERVER = "server"


@dataclass(frozen=True, slots=True)
class TaskSubmitted:
    """A task was accepted; it is acknowledged once this event is durable."""

    task: Task
    at: float

    def __str__(self) -> str:
        task = self.task
        return (
            f"task {task.id} submitted by {task.submitter}: {task.goal} "
            f"for vehicle {task.vehicle}, priority {task.priority}"
        )


@dataclass(frozen=True, slots=True)
class TaskChanged:
    """A task moved along one edge of the lifecycle table."""

    task_id: TaskId
    vehicle: int
    version: int
    old: TaskState
    new: TaskState
    reason: TaskReason
    actor: str
    at: float
    progress: Progress

    def __str__(self) -> str:
        why = f" ({self.reason.name})" if self.reason else ""
        return f"task {self.task_id} {self.new.name.lower()}{why} by {self.actor}"


@dataclass(frozen=True, slots=True)
class TaskWithdrawn:
    """A submission that did not become durable in time and was refused: it never was a task."""

    task_id: TaskId
    vehicle: int
    at: float

    def __str__(self) -> str:
        return f"task {self.task_id} withdrawn: not stored in time"


@dataclass(frozen=True, slots=True)
class SubmissionRefused:
    """A submission refused, for the audit log."""

    vehicle: int
    command: int
    reason: TaskReason
    text: str
    actor: str
    at: float

    def __str__(self) -> str:
        return f"command {self.command} of {self.actor} refused ({self.reason.name}): {self.text}"


@dataclass(frozen=True, slots=True)
class QueuePaused:
    """A vehicle's queue stands; STOPPED is the STOP latch."""

    vehicle: int
    reason: TaskReason
    actor: str
    at: float

    def __str__(self) -> str:
        return f"queue of vehicle {self.vehicle} paused ({self.reason.name}) by {self.actor}"


@dataclass(frozen=True, slots=True)
class QueueContinued:
    """A vehicle's queue goes on."""

    vehicle: int
    actor: str
    at: float

    def __str__(self) -> str:
        return f"queue of vehicle {self.vehicle} continued by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleSeen:
    """A vehicle was found, or is heard again."""

    vehicle: int
    text: str
    at: float

    def __str__(self) -> str:
        return f"vehicle {self.vehicle}: {self.text}"


@dataclass(frozen=True, slots=True)
class VehicleNoted:
    """Something about a vehicle that its operator should read: silent, taken over, restarted."""

    vehicle: int
    text: str
    at: float

    def __str__(self) -> str:
        return f"vehicle {self.vehicle}: {self.text}"


@dataclass(frozen=True, slots=True)
class ServerStopped:
    """The orderly end: every vehicle stands, or the time allowed for it is over."""

    at: float

    def __str__(self) -> str:
        return "server stopped"


Event = (
    TaskSubmitted
    | TaskChanged
    | TaskWithdrawn
    | SubmissionRefused
    | QueuePaused
    | QueueContinued
    | VehicleSeen
    | VehicleNoted
    | ServerStopped
)
