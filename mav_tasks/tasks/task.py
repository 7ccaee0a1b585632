"""What a task is: frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from math import degrees
from typing import NewType

from mav_tasks.tasks.lifecycle import TaskReason, TaskState

TaskId = NewType("TaskId", int)
MAX_TASK_ID = 16_777_215  # 2**24 - 1: exact in a float32 command parameter

DEFAULT_PRIORITY = 5
MAX_PRIORITY = 10  # 10 runs first


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a vehicle stands in its local frame: metres north and east, yaw in radians."""

    north: float
    east: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Move:
    """Drive straight along the heading at the start.

    ``distance`` in metres, negative = backwards; ``speed`` in m/s, positive, None = default.
    """

    distance: float
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class Rotate:
    """Turn on the spot: ``angle`` in radians, clockwise positive, may exceed a full turn.

    ``rate`` in rad/s, positive, None = default.
    """

    angle: float
    rate: float | None = None


Goal = Move | Rotate


def describe(goal: Goal) -> str:
    """Give a goal in words, and in the units of its command."""
    match goal:
        case Move(distance=distance):
            return f"move {distance:g} m"
        case Rotate(angle=angle):
            return f"rotate {degrees(angle):.6g} deg"


@dataclass(frozen=True, slots=True)
class Submitter:
    """Who submitted a task: link, endpoint on it, and MAVLink address.

    All QGroundControls are 255/190 and all MAVSDK scripts 245/190: only the endpoint tells two of
    them apart.
    """

    link: str
    endpoint: str
    system_id: int
    component_id: int

    def __str__(self) -> str:
        return f"{self.system_id}/{self.component_id}@{self.endpoint}"


@dataclass(frozen=True, slots=True)
class Draft:
    """A submission that passed parsing, before it has an id. ``command`` is the MAV_CMD number."""

    vehicle: int
    command: int
    goal: Goal
    priority: int
    submitter: Submitter
    nonce: int = 0


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a task has come; enough to resume it exactly.

    ``anchor`` is the pose from which the goal counts (None: not begun), ``done`` the metres along
    the line or the radians turned since then, ``execution_time`` the seconds spent EXECUTING.
    """

    anchor: Pose | None = None
    done: float = 0.0
    execution_time: float = 0.0


@dataclass(frozen=True, slots=True)
class Task:
    """One task as its events have left it; ``version`` counts them."""

    id: TaskId
    vehicle: int
    command: int
    goal: Goal
    priority: int
    submitter: Submitter
    nonce: int
    submitted_at: float
    state: TaskState = TaskState.QUEUED
    reason: TaskReason = TaskReason.NONE
    version: int = 1
    progress: Progress = Progress()

    @property
    def length(self) -> float:
        """The whole of the goal: metres to drive or radians to turn, unsigned."""
        match self.goal:
            case Move(distance=distance):
                return abs(distance)
            case Rotate(angle=angle):
                return abs(angle)

    @property
    def remaining(self) -> float:
        """What is left of ``length``, never below 0."""
        return max(0.0, self.length - self.progress.done)
