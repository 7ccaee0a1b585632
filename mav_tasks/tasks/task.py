"""What a task is: frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from math import degrees
from typing import NewType

from mav_tasks.tasks.lifecycle import TaskReason, TaskState

TaskId = NewType("TaskId", int)
MAX_TASK_ID = 16_777_215  # 2**24 - 1: exact in a float32 command parameter

DEFAULT_PRIORITY = 5
MAX_PRIORITY = 10  # 10 runs first

SAME_BOOT = 5.0  # s between two estimates of when a vehicle booted, that may be of the same boot


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a vehicle stands in its local frame: metres north and east, yaw in radians."""

    north: float
    east: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Frame:
    """Which local frame coordinates are in: its origin, if known, and when the vehicle booted.

    ``booted_at`` in monotonic seconds, good to a second or two. Another boot is another frame.
    """

    latitude_degE7: int | None
    longitude_degE7: int | None
    booted_at: float


def same_frame(one: Frame | None, other: Frame | None) -> bool:
    """Whether coordinates of one frame mean the same in the other, as far as can be told."""
    if one is None or other is None:
        return False
    known = (one.latitude_degE7, one.longitude_degE7)
    others = (other.latitude_degE7, other.longitude_degE7)
    same_origin = None in (*known, *others) or known == others
    return same_origin and abs(one.booted_at - other.booted_at) <= SAME_BOOT


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


@dataclass(frozen=True, slots=True)
class Drive:
    """Keep a velocity for a time: m/s forward, rad/s clockwise, ``duration`` in seconds."""

    forward: float
    yaw_rate: float
    duration: float


@dataclass(frozen=True, slots=True)
class LocalPlace:
    """A place in the vehicle's own local frame, metres north and east of its origin."""

    north: float
    east: float


@dataclass(frozen=True, slots=True)
class GlobalPlace:
    """A place on earth, exact as MAVLink's integers have it."""

    latitude_degE7: int
    longitude_degE7: int


Place = LocalPlace | GlobalPlace


@dataclass(frozen=True, slots=True)
class GoTo:
    """Drive to a place in a straight line, facing forward.

    ``place`` None is the vehicle's home. ``speed`` in m/s, None = default. ``radius`` in metres is
    near enough, None = as near as a move ends. ``yaw`` in radians is turned to in the end, None =
    as it comes. ``wait`` in seconds is spent there, standing.
    """

    place: Place | None
    speed: float | None = None
    radius: float | None = None
    yaw: float | None = None
    wait: float = 0.0


@dataclass(frozen=True, slots=True)
class Face:
    """Turn on the spot to a heading.

    ``yaw`` in radians from north; ``direction`` 1 clockwise, -1 counter-clockwise, 0 the shorter
    way; ``rate`` in rad/s, None = default.
    """

    yaw: float
    direction: int = 0
    rate: float | None = None


@dataclass(frozen=True, slots=True)
class Head:
    """Drive towards a heading for a time: ``yaw`` in radians, ``forward`` in m/s.

    ``is_relative``: the yaw counts from the heading at the start.
    """

    yaw: float
    forward: float
    duration: float
    is_relative: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """Stand for ``duration`` seconds."""

    duration: float


Goal = Move | Rotate | Drive | GoTo | Face | Head | Wait


def describe(goal: Goal) -> str:
    """Give a goal in words, and in the units of its command."""
    if isinstance(goal, GoTo):
        return _describe_way(goal.place)
    match goal:
        case Move(distance=distance):
            return f"move {distance:g} m"
        case Rotate(angle=angle):
            return f"rotate {degrees(angle):.6g} deg"
        case Drive(forward=forward, duration=duration):
            return f"drive {forward:g} m/s for {duration:g} s"
        case Face(yaw=yaw):
            return f"face {degrees(yaw) % 360:.6g} deg"
        case Head(forward=forward, duration=duration):
            return f"head {forward:g} m/s for {duration:g} s"
        case Wait(duration=duration):
            return f"wait {duration:g} s"


def _describe_way(place: Place | None) -> str:
    match place:
        case None:
            return "return home"
        case LocalPlace(north=north, east=east):
            return f"go to {north:.2f} m N, {east:.2f} m E"
        case GlobalPlace(latitude_degE7=latitude, longitude_degE7=longitude):
            return f"go to {latitude / 1e7:.6f}, {longitude / 1e7:.6f}"


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

    def __hash__(self) -> int:
        return hash(self.endpoint)  # nearly unique, and a string keeps its hash

    def __str__(self) -> str:
        return f"{self.address}@{self.endpoint}"

    @property
    def address(self) -> str:
        """The MAVLink address in words."""
        return f"{self.system_id}/{self.component_id}"


@dataclass(frozen=True, slots=True)
class Marks:
    """By what a submission is recognised when it comes again.

    ``payload`` and ``packet`` are digests: of what it asks for, and of the packet byte by byte.
    ``nonce`` is the client's own mark, 0 for none.
    """

    nonce: int = 0
    payload: str = ""
    packet: str = ""


@dataclass(frozen=True, slots=True)
class Terms:
    """On what terms a task waits and runs; all of it can be modified later.

    ``start_at`` and ``deadline`` are monotonic seconds: not begun before, begun by then;
    ``start_utc`` is in seconds since 1970. ``after`` is the id of the task that must complete
    first, 0 for none.
    """

    priority: int = DEFAULT_PRIORITY
    after: int = 0
    start_at: float | None = None
    start_utc: int | None = None
    deadline: float | None = None
    is_preemptible: bool = True
    is_preemptive: bool = False


@dataclass(frozen=True, slots=True)
class Draft:
    """A submission that passed parsing, before it has an id. ``command`` is the MAV_CMD number."""

    vehicle: int
    command: int
    goal: Goal
    submitter: Submitter
    terms: Terms = Terms()
    marks: Marks = Marks()


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a task has come; enough to resume it exactly.

    ``leg`` is the part of the goal that is being driven, ``anchor`` the pose from which it counts
    (None: not begun), ``done`` the metres along the line, the radians turned or the seconds spent
    since then, ``target`` the place that a GoTo means; ``frame`` is the local frame that both are
    in. ``execution_time`` is the seconds spent EXECUTING, all legs together.
    """

    anchor: Pose | None = None
    done: float = 0.0
    execution_time: float = 0.0
    leg: int = 0
    target: LocalPlace | None = None
    frame: Frame | None = None


@dataclass(frozen=True, slots=True)
class Task:
    """One task as its events have left it; ``version`` counts them."""

    id: TaskId
    vehicle: int
    command: int
    goal: Goal
    submitter: Submitter
    marks: Marks
    submitted_at: float
    terms: Terms = Terms()
    state: TaskState = TaskState.QUEUED
    reason: TaskReason = TaskReason.NONE
    version: int = 1
    progress: Progress = Progress()

    @property
    def priority(self) -> int:
        """0–10, 10 runs first: as submitted or modified."""
        return self.terms.priority

    @property
    def nonce(self) -> int:
        """The client's own mark, 0 for none."""
        return self.marks.nonce
