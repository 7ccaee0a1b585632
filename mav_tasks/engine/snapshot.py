"""An immutable view of the whole server, for the command line, logs and tests."""

from dataclasses import dataclass
from typing import NamedTuple

from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import Task, TaskId


class Reach(NamedTuple):
    """Which vehicles a gateway hears and has."""

    heard: frozenset[int]  # whether it has them or not
    ours: frozenset[int]  # that it has
    strays: frozenset[int]  # of these, those not heard for a while that it can forget now


@dataclass(frozen=True, slots=True)
class VehicleSnapshot:
    """The state of one vehicle."""

    system_id: int
    persona: str
    armed: bool
    heard: bool
    control: str  # phase of our offboard control
    paused: TaskReason
    active: Task | None
    waiting: tuple[TaskId, ...]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state of the server at one moment."""

    vehicles: tuple[VehicleSnapshot, ...]
    clients: tuple[str, ...]
    tasks: tuple[Task, ...]
    decoded: str  # packet counts of the vehicle side and the client side
