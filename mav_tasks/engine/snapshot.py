"""An immutable view of the whole server, for command line, logs and tests."""

from dataclasses import dataclass

from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task, TaskId


@dataclass(frozen=True, slots=True)
class VehicleSnapshot:
    """One vehicle."""

    system_id: int
    persona: str
    armed: bool
    heard: bool
    control: str  # how far our control has come
    paused: TaskReason
    active: Task | None
    waiting: tuple[TaskId, ...]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The server at one moment."""

    vehicles: tuple[VehicleSnapshot, ...]
    clients: tuple[str, ...]
    tasks: tuple[Task, ...]
    decoded: str  # counts of what came in, vehicle side and client side
