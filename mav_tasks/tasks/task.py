"""Tasks and their parts, as frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from typing import NewType

from mav_tasks.kinds import Bend, GoTo, LocalPlace, Pose
from mav_tasks.tasks.goal import Goal
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.timing import Timing

TaskId = NewType("TaskId", int)
#: the largest that a float parameter can carry (``mavlink.float_param``): 34 years at one task/s
MAX_TASK_ID = 0x3F7FFFFF
MAX_NONCE = MAX_TASK_ID
#: in place of a vehicle's system id: the server chooses one
ANY = 0


def following(task_id: int) -> TaskId:
    """Return the id after this one; 1 follows MAX_TASK_ID."""
    return TaskId(task_id % MAX_TASK_ID + 1)


DEFAULT_PRIORITY = 5
MAX_PRIORITY = 10  # 10 runs first
MAX_DELAY = 31_536_000.0  # s, a year, until a task starts, or expires

#: degE7, 0.1 m: an origin computed from positions varies by 1 each time (ArduPilot 4.6.3)
SAME_ORIGIN = 10
CLOCK_ERROR = 0.12  # of the elapsed time: simulators run at 0.9 or less, a real clock at 0.9999
SAME_BOOT = 5.0  # s; two estimates of the boot time this close may be of the same boot


@dataclass(frozen=True, slots=True)
class Frame:
    """The identity of a vehicle's local frame: its origin, if known, and the vehicle's boot time.

    ``booted_at`` is in monotonic seconds, estimated at ``heard_at``, and good to a second or two.
    It drifts later if the vehicle's clock is slow. A reboot begins a new frame.
    """

    latitude_degE7: int | None
    longitude_degE7: int | None
    booted_at: float
    heard_at: float | None = None  # monotonic seconds


def same_frame(one: Frame | None, other: Frame | None) -> bool:
    """Return whether coordinates mean the same in both frames, as far as is known."""
    if one is None or other is None:
        return False
    is_near = _is_near(one.latitude_degE7, other.latitude_degE7) and _is_near(
        one.longitude_degE7, other.longitude_degE7
    )
    return is_near and abs(one.booted_at - other.booted_at) <= SAME_BOOT + _drift(one, other)


def _is_near(one_degE7: int | None, other_degE7: int | None) -> bool:
    return one_degE7 is None or other_degE7 is None or abs(one_degE7 - other_degE7) <= SAME_ORIGIN


def _drift(one: Frame, other: Frame) -> float:
    """Return the seconds by which a vehicle's clock may have drifted between two estimates."""
    if one.heard_at is None or other.heard_at is None:
        return 0.0
    return CLOCK_ERROR * abs(one.heard_at - other.heard_at)


@dataclass(frozen=True, slots=True)
class Submitter:
    """The client that submitted a task: link, endpoint on it, MAVLink address, and key.

    Every QGroundControl is 255/190 and every MAVSDK script 245/190, so only the endpoint
    distinguishes two of them.
    """

    link: str
    endpoint: str
    system_id: int
    component_id: int
    #: name of the signing key, "" for none
    key: str = ""
    #: of that key: its name may be given again
    fingerprint: str = ""

    def __hash__(self) -> int:
        return hash(self.endpoint)  # nearly unique, and a string caches its hash

    def __str__(self) -> str:
        signed = f" signed {self.key}" if self.key else ""
        return f"{self.place}{signed}"

    @property
    def place(self) -> str:
        """MAVLink address and endpoint as text, the form in which settings name a client."""
        return f"{self.address}@{self.endpoint}"

    @property
    def owner(self) -> str:
        """Owner of the client's tasks: its key if it has one, otherwise its link and endpoint."""
        return self.fingerprint if self.key else f"{self.link} {self.endpoint}"

    @property
    def address(self) -> str:
        """MAVLink address as text."""
        return f"{self.system_id}/{self.component_id}"


@dataclass(frozen=True, slots=True)
class Marks:
    """The fields that identify a repeated submission.

    ``payload`` is a digest of the request, ``packet`` a digest of the packet's bytes. ``nonce`` is
    chosen by the client, 0 for none.
    """

    nonce: int = 0
    payload: str = ""
    packet: str = ""


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """The place in the queue of a task of this priority and id that came at this time."""

    priority: int
    at: float
    task_id: float


@dataclass(frozen=True, slots=True)
class Terms:
    """When and how a task runs; every term can be modified later.

    A task does not start before ``start_at`` (monotonic seconds) and ``start_utc`` (seconds since
    1970), and expires if it has not started by ``deadline`` (monotonic seconds). ``after`` is the
    id of the task that must complete first, 0 for none. ``is_staged``: it waits for a start
    command. ``top_speed`` in m/s limits any other speed; None: only the settings limit it.
    ``max_distance`` in m limits the way of the whole task, with all interruptions; None: nothing.
    ``is_cruising``: if the goal names no speed, the task drives at the vehicle's own cruise speed.
    ``label`` is the submitter's name for the task, "" for none; it changes nothing. ``place`` is
    where somebody has put it in the queue; None: where its priority puts it.

    ``repeat`` says when the task runs again (``tasks/repetition.py``), "" for never; ``series`` is
    the id of the first run of its series, 0 if it is in none. A task that repeats has a start time,
    and instead of ``deadline`` ``start_within``: the seconds after its start time.
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
    repeat: str = ""
    series: int = 0
    start_within: float | None = None
    max_distance: float | None = None
    place: QueuePlace | None = None

    @property
    def standing(self) -> int:
        """The highest priority that counts for it: its own, or that of its place."""
        return max(self.priority, self.place.priority if self.place else 0)


@dataclass(frozen=True, slots=True)
class Draft:
    """A parsed submission that has no id yet. ``command`` is the MAV_CMD number.

    ``vehicle`` is ANY before the server has chosen one; ``choice`` says why it chose it.
    """

    vehicle: int
    command: int
    goal: Goal
    submitter: Submitter
    terms: Terms = Terms()
    marks: Marks = Marks()
    choice: str = ""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a task has got; enough to resume it exactly.

    ``leg`` is the leg being driven and ``anchor`` the pose where it started (None: not started).
    ``done`` is the metres along the line, the radians turned or the seconds spent since the anchor.
    ``target`` is the place of a GoTo. ``frame`` is the local frame of anchor and target. ``path``
    leads from the anchor to the end of the leg if the vehicle steers as a car. ``execution_time``
    is the seconds in EXECUTING, over all legs.

    In a plan, ``step`` is the step being driven (-1: not started), and legs are legs of that step.
    ``jumps`` are pairs of a jump's step and how often it was taken. ``pending`` are the steps on
    the way that are still to be done; the first of them has waited for ``pending_for`` seconds.
    ``speed`` is the last one set by the plan or a client, m/s; ``backwards`` says whether the plan
    drives backwards. ``driven`` is the metres that were commanded so far, over all legs. ``share``
    is the part of it that is done, 0 to 1, by time; it never falls.
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
    driven: float = 0.0
    backwards: bool = False
    share: float = 0.0


@dataclass(frozen=True, slots=True)
class Task:
    """One task, the result of its events; ``version`` counts its changes.

    ``timing`` covers its setpoints up to the last time it left EXECUTING. ``changed_at`` is when
    its state last changed, monotonic seconds, None if it never did. ``choice`` says why the server
    chose its vehicle; "" if the submitter named it.
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
    choice: str = ""

    @property
    def is_click(self) -> bool:
        """Whether it is a place at the autopilot's address: an autopilot keeps only the last."""
        is_place = isinstance(self.goal, GoTo) and self.goal.place is not None
        return is_place and self.terms.is_cruising

    @property
    def priority(self) -> int:
        """Priority as submitted or modified, 0–10; 10 runs first."""
        return self.terms.priority

    @property
    def ended_at(self) -> float:
        """When a task that is over ended, monotonic seconds."""
        return self.submitted_at if self.changed_at is None else self.changed_at

    @property
    def is_made(self) -> bool:
        """Whether the server made it, as a later run of a series."""
        return self.terms.series not in (0, self.id)
