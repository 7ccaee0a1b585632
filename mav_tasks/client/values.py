"""Frozen values decoded from the server's messages. SI units."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import inf, isfinite
from typing import TypeVar

from mav_tasks.kinds import Unit
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.special_values import (
    NO_HEARTBEAT,
    SHARES_ID,
    UNKNOWN_POSITION,
    UNKNOWN_PROGRESS,
)
from mav_tasks.tasks.lifecycle import ACTIVE, TERMINAL, WAITING, TaskReason, TaskState, words_of

E = TypeVar("E", bound=IntEnum)


@dataclass(frozen=True, slots=True)
class TaskStatus:
    """The last status of one task.

    ``progress`` is 0 to 1, ``remaining`` is in ``unit``, times are in seconds; None: unknown.
    ``position`` is the number of tasks that run before it; only answers to a request have it.
    ``item`` of ``items`` is the plan item being driven, from 1 as in its file; for other tasks it
    is the leg. ``version`` grows with each change. ``halt_epoch`` grows with each event that halts
    its rover. ``label`` is the submitter's name for it, "" for none. ``ended_ago``: seconds from
    its end to the answer of a request; None: it has not ended, or the server does not say.
    ``every``: it repeats, so many seconds from one start to the next, or at the times of a cron
    expression; None: it does not. ``series``: id of the first run of its series; None: in none.
    """

    id: int
    vehicle: int
    state: TaskState
    reason: TaskReason
    words: str
    priority: int
    after: int
    nonce: int
    command: int
    progress: float | None
    remaining: float | None
    unit: Unit
    position: int | None
    time_to_start: float | None
    time_to_finish: float | None
    execution_time: float | None
    item: int
    items: int
    submitter: str
    version: int
    halt_epoch: int = 0
    label: str = ""
    ended_ago: float | None = None
    every: int | str | None = None
    series: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has ended, in any final state."""
        return self.state in TERMINAL

    @property
    def is_active(self) -> bool:
        """Whether it has started and not ended."""
        return self.state in ACTIVE

    @property
    def is_waiting(self) -> bool:
        """Whether it has not started."""
        return self.state in WAITING


@dataclass(frozen=True, slots=True)
class QueueStatus:
    """A rover's queue. ``paused`` is the reason why it is paused, None: it is not.

    ``counts`` are its tasks by state. ``waiting`` are the requested waiting tasks in the order in
    which they run; tasks that wait for a time or another task come last. ``halt_epoch`` grows with
    each event that halts the rover. ``heartbeat_age``: seconds since the rover's last heartbeat
    reached the server; inf: none since the server started; None: the server does not say.
    ``gateway`` is the one of a fleet that has the rover, "" if the server is alone.
    ``shares_id``: another rover with the same system id is heard, which the server ignores.
    """

    vehicle: int
    running: int | None
    next: int | None
    capacity: int
    counts: Mapping[TaskState, int]
    paused: TaskReason | None
    waiting: tuple[TaskStatus, ...]
    current: TaskStatus | None
    version: int
    halt_epoch: int = 0
    heartbeat_age: float | None = None
    gateway: str = ""
    shares_id: bool = False

    @property
    def waiting_count(self) -> int:
        """The number of tasks that have not started."""
        return sum(self.counts.get(state, 0) for state in WAITING)


@dataclass(frozen=True, slots=True)
class TaskTiming:
    """How evenly the setpoints of a task left the server while it was being driven.

    ``rate`` is the server's setpoint rate, Hz. ``count`` is the number of intervals between two
    setpoints; ``p50`` and ``p99`` are their percentiles and ``max`` the longest, in seconds; None
    without an interval. ``late`` intervals were longer than 1.5 / ``rate``.
    """

    id: int
    vehicle: int
    rate: float
    count: int
    late: int
    p50: float | None
    p99: float | None
    max: float | None


@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """A rover as its telemetry shows it. ``north`` and ``east`` in m, ``yaw`` in rad, ``speed`` in
    m/s, ``latitude`` and ``longitude`` in deg, ``battery`` 0 to 1, ``voltage`` in V; None, or
    "unknown" for ``kind`` and ``mode``: not received. ``position_age``: seconds since its position
    arrived. ``is_ready``: its checks before arming pass; None: it does not say. ``is_heard``: its
    heartbeats arrive. ``server_component`` is the task server's component id in the rover's system.
    ``heartbeat_age``: seconds since its last heartbeat; inf: none since the server started; None:
    none arrived here, and the server does not say.
    """

    id: int
    kind: str
    armed: bool | None
    mode: str
    is_heard: bool
    server_component: int
    north: float | None = None
    east: float | None = None
    yaw: float | None = None
    speed: float | None = None
    heartbeat_age: float | None = None
    latitude: float | None = None
    longitude: float | None = None
    position_age: float | None = None
    battery: float | None = None
    voltage: float | None = None
    is_ready: bool | None = None


#: severities of the text that says why a request was refused
REFUSES = (MavSeverity.ERROR, MavSeverity.WARNING)


@dataclass(frozen=True, slots=True)
class Text:
    """A STATUSTEXT: its sender, ``severity`` 0 (emergency) to 7 (debug), and the text."""

    vehicle: int
    component: int
    severity: int
    words: str


@dataclass(frozen=True, slots=True)
class VehicleChanged:
    """Packets of a rover arrived: ``Client.vehicles`` returns its new state."""

    vehicle: int


#: what ``Client.listen`` reports; a QueueStatus without its tasks
News = TaskStatus | QueueStatus | Text | VehicleChanged


def task_status_of(message: m.TaskStatus, vehicle: int) -> TaskStatus:
    """Return a decoded TASK_STATUS; ``vehicle`` is the sender's system id."""
    reason = member_of(message.reason, TaskReason.NONE)
    finish = known(message.time_to_finish)
    is_over = message.state in TERMINAL
    return TaskStatus(
        id=message.task_id,
        vehicle=vehicle,
        state=member_of(message.state, TaskState.UNKNOWN),
        reason=reason,
        words=_text(message._text_raw) or words_of(reason),
        priority=message.priority,
        after=message.after_task_id,
        nonce=message.nonce,
        command=message.command,
        progress=None if message.progress == UNKNOWN_PROGRESS else message.progress / 100,
        remaining=known(message.remaining),
        unit=member_of(message.remaining_unit, Unit.NONE),
        position=None if message.queue_position == UNKNOWN_POSITION else message.queue_position,
        time_to_start=known(message.time_to_start),
        time_to_finish=None if is_over else finish,
        execution_time=known(message.execution_time),
        item=message.step + 1,
        items=message.step_count,
        submitter=f"{message.submitter_system}/{message.submitter_component}",
        version=message.version,
        halt_epoch=message.halt_epoch,
        label=_text(message._label_raw),
        ended_ago=-finish if is_over and finish is not None else None,
        every=every_of(_text(message._repeat_raw)),
        series=message.series or None,
    )


def every_of(repeat: str) -> int | str | None:
    """Return a repetition: seconds, or a cron expression; None: no repetition."""
    return int(repeat) if repeat.isdigit() else repeat or None


def task_timing_of(message: m.TaskTiming, vehicle: int) -> TaskTiming:
    """Return a decoded TASK_TIMING; ``vehicle`` is the sender's system id."""
    return TaskTiming(
        id=message.task_id,
        vehicle=vehicle,
        rate=message.rate,
        count=message.count,
        late=message.late,
        p50=known(message.p50),
        p99=known(message.p99),
        max=known(message.longest),
    )


def queue_status_of(
    message: m.TaskQueueStatus,
    vehicle: int,
    waiting: tuple[TaskStatus, ...],
    current: TaskStatus | None,
) -> QueueStatus:
    """Return a decoded TASK_QUEUE_STATUS, with tasks that were requested separately."""
    counts = {
        state: count for state, count in zip(TaskState, message.counts, strict=False) if count
    }
    return QueueStatus(
        vehicle=vehicle,
        running=message.running_id or None,
        next=message.next_id or None,
        capacity=message.capacity,
        counts=counts,
        paused=member_of(message.paused_reason, TaskReason.NONE) if message.paused_reason else None,
        waiting=waiting,
        current=current,
        version=message.version,
        halt_epoch=message.halt_epoch,
        heartbeat_age=heartbeat_age_of(message),
        gateway=_text(message._gateway_raw),
        shares_id=shares_id(message),
    )


def shares_id(message: m.TaskQueueStatus) -> bool:
    """Return whether another rover with the same system id is heard."""
    return bool(message.flags & SHARES_ID)


def heartbeat_age_of(message: m.TaskQueueStatus) -> float | None:
    """Return s since the rover's last heartbeat; inf: none; None: the server does not say."""
    if not message.heartbeat_age:
        return None
    return inf if message.heartbeat_age == NO_HEARTBEAT else message.heartbeat_age / 1000


def member_of(number: int, otherwise: E) -> E:
    """Return the enum's member with a number; ``otherwise`` for one of a newer server."""
    kind = type(otherwise)
    return kind(number) if number in kind._value2member_map_ else otherwise


def known(value: float) -> float | None:
    """Return the number; None if it is NaN or infinite."""
    return value if isfinite(value) else None


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("utf-8", "replace")
