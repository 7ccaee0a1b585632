"""What a task is: frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from typing import NewType

from mav_tasks.tasks.goal import Goal, LocalPlace
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.timing import Timing

TaskId = NewType("TaskId", int)
#: the largest that a parameter can name (``mavlink.float_param``): 34 years of a task a second
MAX_TASK_ID = 0x3F7FFFFF
MAX_NONCE = MAX_TASK_ID


def following(task_id: int) -> TaskId:
    """Return the id that is given after this one."""
    return TaskId(task_id % MAX_TASK_ID + 1)


DEFAULT_PRIORITY = 5
MAX_PRIORITY = 10  # 10 runs first

#: degE7, 0.1 m: one that is worked out from positions differs by 1 each time (ArduPilot 4.6.3)
SAME_ORIGIN = 10
CLOCK_ERROR = 0.12  # of the time: simulators run at 0.9 of it and less, a real clock at 0.9999
SAME_BOOT = 5.0  # s between two estimates of when a vehicle booted, that may be of the same boot


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a vehicle stands in its local frame: metres north and east, yaw in radians."""

    north: float
    east: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Bend:
    """A piece of a path: ``length`` m on a circle or straight on, negative if driven backwards.

    ``curvature`` in 1/m, positive where driving forwards turns clockwise, 0 = straight.
    """

    curvature: float
    length: float


@dataclass(frozen=True, slots=True)
class Frame:
    """Which local frame coordinates are in: its origin, if known, and when the vehicle booted.

    ``booted_at`` in monotonic seconds, as of ``heard_at``, good to a second or two; a vehicle whose
    clock is slow seems to have booted later and later. Another boot is another frame.
    """

    latitude_degE7: int | None
    longitude_degE7: int | None
    booted_at: float
    heard_at: float | None = None  # monotonic seconds


def same_frame(one: Frame | None, other: Frame | None) -> bool:
    """Whether coordinates of one frame mean the same in the other, as far as can be told."""
    if one is None or other is None:
        return False
    is_near = _is_near(one.latitude_degE7, other.latitude_degE7) and _is_near(
        one.longitude_degE7, other.longitude_degE7
    )
    return is_near and abs(one.booted_at - other.booted_at) <= SAME_BOOT + _drift(one, other)


def _is_near(one_degE7: int | None, other_degE7: int | None) -> bool:
    return one_degE7 is None or other_degE7 is None or abs(one_degE7 - other_degE7) <= SAME_ORIGIN


def _drift(one: Frame, other: Frame) -> float:
    """Return by how many seconds a vehicle's clock may have gone wrong between the two."""
    if one.heard_at is None or other.heard_at is None:
        return 0.0
    return CLOCK_ERROR * abs(one.heard_at - other.heard_at)


@dataclass(frozen=True, slots=True)
class Submitter:
    """Who submitted a task: link, endpoint on it, MAVLink address, and key.

    All QGroundControls are 255/190 and all MAVSDK scripts 245/190: only the endpoint tells two of
    them apart.
    """

    link: str
    endpoint: str
    system_id: int
    component_id: int
    #: name of the key that signed it, "" for none
    key: str = ""

    def __hash__(self) -> int:
        return hash(self.endpoint)  # nearly unique, and a string keeps its hash

    def __str__(self) -> str:
        signed = f" signed {self.key}" if self.key else ""
        return f"{self.place}{signed}"

    @property
    def place(self) -> str:
        """MAVLink address and endpoint in words, as settings name a client."""
        return f"{self.address}@{self.endpoint}"

    @property
    def owner(self) -> str:
        """Whose its tasks are: of all who sign with its key, or of its endpoint."""
        return f"key {self.key}" if self.key else f"{self.link} {self.endpoint}"

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
    first, 0 for none. ``is_staged``: waits until somebody starts it. ``top_speed`` in m/s: it is
    driven no faster, whatever speed is set; None: as fast as the settings allow. ``is_cruising``:
    where it names no speed it is driven as fast as the vehicle itself would. ``label`` is a name
    that its submitter gave it, "" for none; it changes nothing.
    """

    priority: int = DEFAULT_PRIORITY
    after: int = 0
    start_at: float | None = None
    start_utc: int | None = None
    deadline: float | None = None
    is_preemptible: bool = True
    is_preemptive: bool = False
    is_staged: bool = False
    top_speed: float | None = None
    is_cruising: bool = False
    label: str = ""


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
    in. ``path`` is the way from the anchor to the end of the leg, where the vehicle steers as a
    car. ``execution_time`` is the seconds spent EXECUTING, all legs together.

    Of a plan, ``step`` is the one that is being driven (-1: not begun) and legs are its legs;
    ``jumps`` are pairs of a jump's step and how often it was made, ``pending`` the steps on the way
    that are still to be done, the first of them waiting for ``pending_for`` seconds; ``speed`` is
    what the plan, or somebody meanwhile, has set, m/s.
    """

    anchor: Pose | None = None
    done: float = 0.0
    execution_time: float = 0.0
    leg: int = 0
    target: LocalPlace | None = None
    frame: Frame | None = None
    step: int = -1
    jumps: tuple[int, ...] = ()
    pending: tuple[int, ...] = ()
    pending_for: float = 0.0
    speed: float | None = None
    path: tuple[Bend, ...] = ()


@dataclass(frozen=True, slots=True)
class Task:
    """One task as its events have left it; ``version`` counts them.

    ``timing`` is that of its setpoints, as of the last time that it stopped being driven;
    ``changed_at`` is when its state changed last, monotonic seconds, None if it never did.
    """

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
    timing: Timing | None = None
    changed_at: float | None = None

    @property
    def priority(self) -> int:
        """0–10, 10 runs first: as submitted or modified."""
        return self.terms.priority

    @property
    def nonce(self) -> int:
        """The client's own mark, 0 for none."""
        return self.marks.nonce
