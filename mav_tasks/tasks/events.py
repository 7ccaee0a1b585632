"""The events of the journal, as frozen values.

A task is the result of its events. ``at`` is in monotonic seconds; the store and the log add
wall-clock time. ``actor`` is a client, or "server".
"""

from collections.abc import Iterator
from dataclasses import dataclass

from mav_tasks.tasks.cron import utc_text
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of
from mav_tasks.tasks.task import Frame, Progress, Task, TaskId, Terms
from mav_tasks.tasks.timing import Timing

SERVER = "server"

#: new states, with the reason that adds nothing to the actor's name
_ASKED_FOR = {
    (TaskState.PAUSED, TaskReason.OPERATOR),
    (TaskState.CANCELLED, TaskReason.CANCELLED),
    (TaskState.KILLED, TaskReason.CANCELLED),
}


class _OfVehicle:
    """An event of one vehicle; its text begins with that."""

    __slots__ = ()
    vehicle: int

    def __str__(self) -> str:
        return f"rover {self.vehicle}: {self._text()}"

    def _text(self) -> str:
        raise NotImplementedError


@dataclass(frozen=True, slots=True)
class TaskSubmitted:
    """A task was accepted; the server acknowledges it once this event is durable."""

    task: Task
    at: float

    def __str__(self) -> str:
        task = self.task
        label = f" '{task.terms.label}'" if task.terms.label else ""
        run = f", a run of series {task.terms.series}" if task.is_made else ""
        return (
            f"rover {task.vehicle}: task {task.id} submitted: {task.goal.words}{label}, "
            f"priority {task.priority}, by {task.submitter}{run}"
        )


@dataclass(frozen=True, slots=True)
class TaskChanged(_OfVehicle):
    """A task moved along one edge of the lifecycle table.

    ``timing`` covers its setpoints so far; it is new only if ``old`` is EXECUTING.
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

    def _text(self) -> str:
        name, reason, comma = self.new.name.lower(), self.reason, ","
        if (self.new, reason) in _ASKED_FOR:
            reason, comma = TaskReason.NONE, ""  # "paused by", not "paused: operator, by"
        why = f": {words_of(reason)}" if reason else ""
        who = "" if self.actor == SERVER else f"{comma} by {self.actor}"
        driven = f"; {self.timing}" if self.timing and self.old is TaskState.EXECUTING else ""
        return f"task {self.task_id} {name}{why}{who}{driven}"


@dataclass(frozen=True, slots=True)
class TaskAdvanced(_OfVehicle):
    """A task's progress changed, as when it begins its next leg; its state did not."""

    task_id: TaskId
    vehicle: int
    version: int
    progress: Progress
    at: float
    item: int = 0  # its number in the plan's file, from 1; 0: none

    def _text(self) -> str:
        item = f"item {self.item}, " if self.item > 0 else ""
        return f"task {self.task_id}: {item}leg {self.progress.leg + 1} started"


@dataclass(frozen=True, slots=True)
class TaskProgressed(_OfVehicle):
    """Progress of a task that is being driven, stored in case of a crash.

    It is not part of the journal: only the last one of each task is kept. ``version`` is the
    task's, which this event does not change.
    """

    task_id: TaskId
    vehicle: int
    version: int
    progress: Progress
    at: float

    def _text(self) -> str:
        driven = f"{self.progress.execution_time:.0f} s driven"
        return f"task {self.task_id}: {driven}"


@dataclass(frozen=True, slots=True)
class StepReached(_OfVehicle):
    """A step of a plan is done; ``performs``: it is a command that is sent to the vehicle now."""

    task_id: TaskId
    vehicle: int
    step: int
    performs: bool
    at: float
    item: int = 0  # its number in the plan's file, from 1; 0: home

    def _text(self) -> str:
        item = f"item {self.item}" if self.item > 0 else "home"
        done = "sent" if self.performs else "reached"
        return f"task {self.task_id}: {item} {done}"


@dataclass(frozen=True, slots=True)
class ActTold(_OfVehicle):
    """The command of an act, a step of a plan, is sent to the vehicle now."""

    task_id: TaskId
    vehicle: int
    step: int
    at: float
    item: int = 0  # its number in the plan's file, from 1; 0: home

    def _text(self) -> str:
        return f"task {self.task_id}: item {self.item} sent"


@dataclass(frozen=True, slots=True)
class PlanStored(_OfVehicle):
    """A vehicle's mission (``kind`` 0), fence (1) or rally points (2) were replaced or cleared.

    ``plan_id`` names the plan to clients; a mission has the id of the task made from it. ``source``
    is the items as uploaded. If the plan was cleared, ``plan_id`` is 0 and ``source`` empty.
    """

    vehicle: int
    kind: int
    plan_id: int
    source: str
    actor: str
    at: float

    def _text(self) -> str:
        what = ("mission", "fence", "rally points")[self.kind]
        done = f"{self.plan_id} stored" if self.plan_id else "cleared"
        return f"{what} {done} by {self.actor}"


@dataclass(frozen=True, slots=True)
class TaskModified(_OfVehicle):
    """The terms of a task were changed; ``before`` is None in events of older versions."""

    task_id: TaskId
    vehicle: int
    version: int
    terms: Terms
    actor: str
    at: float
    before: Terms | None = None

    def _text(self) -> str:
        what = ""
        if self.before is not None:
            what = f": {changes_of(self.before, self.terms, at=self.at) or 'no change'}"
        return f"task {self.task_id} modified by {self.actor}{what}"


@dataclass(frozen=True, slots=True)
class TaskAssigned(_OfVehicle):
    """The server chose the vehicle of a task that any vehicle may drive; ``choice`` says why.

    ``before`` is the vehicle that it was assigned to before, 0 for none. A task that has begun is
    not assigned again.
    """

    task_id: TaskId
    vehicle: int
    version: int
    before: int
    choice: str
    at: float

    def _text(self) -> str:
        since = f", no longer to rover {self.before}" if self.before else ""
        return f"task {self.task_id} assigned to it{since}: {self.choice}"


@dataclass(frozen=True, slots=True)
class TaskWaits(_OfVehicle):
    """A vehicle's next task cannot start, for a new reason.

    ``words`` is the vehicle's own explanation, "" if there is none.
    """

    task_id: TaskId
    vehicle: int
    reason: TaskReason
    at: float
    words: str = ""

    def _text(self) -> str:
        words = f": {self.words}" if self.words else ""
        return f"task {self.task_id} waits: {words_of(self.reason)}{words}"


@dataclass(frozen=True, slots=True)
class TaskWithdrawn(_OfVehicle):
    """A submission was refused because it was not durable in time; it never was a task."""

    task_id: TaskId
    vehicle: int
    at: float

    def _text(self) -> str:
        return f"task {self.task_id} withdrawn: not stored in time"


@dataclass(frozen=True, slots=True)
class SubmissionRefused:
    """A submission or request was refused; for the audit log.

    ``command`` is 0 for the upload of a plan, and minus the message id for a message that is no
    command.
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
        return f"{rover}{what} by {self.actor} refused: {self.text}"


@dataclass(frozen=True, slots=True)
class QueuePaused(_OfVehicle):
    """A vehicle's queue was paused; the reason STOPPED is the STOP latch."""

    vehicle: int
    reason: TaskReason
    actor: str
    at: float

    def _text(self) -> str:
        if self.reason is TaskReason.STOPPED:
            return f"STOP by {self.actor}; no task runs until a resume"
        if self.reason is TaskReason.OPERATOR and self.actor != SERVER:
            return f"queue paused by {self.actor}"
        return f"queue paused: {words_of(self.reason)}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class QueueContinued(_OfVehicle):
    """A vehicle's queue was resumed."""

    vehicle: int
    actor: str
    at: float

    def _text(self) -> str:
        return f"queue resumed by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleHalted(_OfVehicle):
    """Something halted a vehicle, or would have if it had moved; ``epoch`` counts the halts.

    A request to resume must be newer than the last halt.
    """

    vehicle: int
    epoch: int
    reason: TaskReason
    actor: str
    at: float

    def _text(self) -> str:
        words = f"halt epoch {self.epoch}: {words_of(self.reason)}"
        return words if self.actor == SERVER else f"{words}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleIdentified(_OfVehicle):
    """The vehicle with this system id reported its unique id (AUTOPILOT_VERSION)."""

    vehicle: int
    uid: str
    at: float

    def _text(self) -> str:
        return f"its unique id is {self.uid}"


@dataclass(frozen=True, slots=True)
class VehicleHomeSet(_OfVehicle):
    """A home that an older server kept itself; only its journal has it. Home is the rover's own."""

    vehicle: int
    latitude_degE7: int
    longitude_degE7: int
    frame: Frame
    actor: str
    at: float

    def _text(self) -> str:
        place = f"{self.latitude_degE7 / 1e7:.7f}, {self.longitude_degE7 / 1e7:.7f}"
        who = "where it was first armed" if self.actor == SERVER else f"set by {self.actor}"
        return f"home is {place} ({who})"


@dataclass(frozen=True, slots=True)
class VehicleArmingSet(_OfVehicle):
    """A person's decision whether the server may arm a vehicle: disarming it says no."""

    vehicle: int
    may_arm: bool
    at: float

    def _text(self) -> str:
        words = "may arm it again" if self.may_arm else "does not arm it before a resume"
        return f"the server {words}"


@dataclass(frozen=True, slots=True)
class VehicleSpeedSet(_OfVehicle):
    """The speed of tasks that name none was changed; None: as in the settings."""

    vehicle: int
    speed: float | None
    actor: str
    at: float

    def _text(self) -> str:
        speed = "as configured" if self.speed is None else f"{self.speed:g} m/s"
        return f"default speed {speed}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class VehicleSeen(_OfVehicle):
    """A vehicle was found, is heard again, or has reported something that is in order."""

    vehicle: int
    text: str
    at: float

    def _text(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class VehicleNoted(_OfVehicle):
    """Something about a vehicle that its operator should read: silent, taken over, restarted."""

    vehicle: int
    text: str
    at: float

    def _text(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class ServerStopped:
    """The server shut down: every vehicle stands in HOLD, or the time limit is over.

    ``unconfirmed`` are the vehicles that were told to stop but not yet seen to stand in HOLD.
    """

    unconfirmed: tuple[int, ...]
    at: float

    def __str__(self) -> str:
        if not self.unconfirmed:
            return "server stopped: no rover is being driven"
        names = ", ".join(map(str, self.unconfirmed))
        rovers = "rover" if len(self.unconfirmed) == 1 else "rovers"
        return f"server stopped, HOLD and standstill not confirmed: check {rovers} {names}"


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """A client changed a setting, in the unit of its parameter; None: as configured."""

    name: str
    value: float | None
    actor: str
    at: float

    def __str__(self) -> str:
        value = "as configured" if self.value is None else f"{self.value:g}"
        return f"parameter {self.name}: {value}, by {self.actor}"


@dataclass(frozen=True, slots=True)
class SignatureTime:
    """Timestamp of the last signed packet accepted from one sender, in 10 µs since 2015.

    ``key`` is the fingerprint of the signing key.
    """

    key: str
    link_id: int
    system_id: int
    component_id: int
    timestamp: int


@dataclass(frozen=True, slots=True)
class SignaturesSeen:
    """The last accepted signature timestamps, stored so that no packet is accepted twice.

    ``gone`` are senders that the server has forgotten. ``signed_until``: no signature of our own is
    later than this. The store keeps these events, but not in the journal: there are too many.
    """

    times: tuple[SignatureTime, ...]
    gone: tuple[SignatureTime, ...]
    signed_until: int
    at: float

    def __str__(self) -> str:
        return f"signatures: {len(self.times)} senders heard"


@dataclass(frozen=True, slots=True)
class SignatureRefused:
    """A packet with a valid signature was dropped because of its timestamp.

    ``seconds`` is how long before the server's time it was signed; negative: after it.
    """

    actor: str
    seconds: float
    at: float

    def __str__(self) -> str:
        when = f"{abs(self.seconds):.0f} s {'before' if self.seconds > 0 else 'after'}"
        return (
            f"packet of {self.actor} refused: signed {when} this server's time. Check both clocks;"
            " if they are right, the packet was delayed or replayed"
        )


Event = (
    TaskSubmitted
    | TaskChanged
    | TaskAdvanced
    | TaskProgressed
    | StepReached
    | ActTold
    | PlanStored
    | TaskModified
    | TaskAssigned
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


def changes_of(before: Terms, after: Terms, *, at: float) -> str:
    """Return the changed terms as text; "" if none changed.

    ``at``: time of the change, on the same clock as the start time and the deadline.
    """
    return ", ".join(_changes(before, after, at))


def _changes(before: Terms, after: Terms, at: float) -> Iterator[str]:
    if after.priority != before.priority:
        yield f"priority {after.priority} (was {before.priority})"
    if after.place != before.place:
        yield "another place in the queue"
    if after.after != before.after:
        yield f"runs after task {after.after}" if after.after else "runs after no other task"
    if (after.start_at, after.start_utc) != (before.start_at, before.start_utc):
        yield _start_of(after, at)
    if (after.deadline, after.start_within) != (before.deadline, before.start_within):
        yield _deadline_of(after, at)
    for term, yes, no in (
        ("is_preemptible", "pre-emptible", "not pre-emptible"),
        ("is_preemptive", "pre-emptive", "not pre-emptive"),
        ("is_staged", "needs a start command", "start command received"),
    ):
        if getattr(after, term) != getattr(before, term):
            yield yes if getattr(after, term) else no
    if after.repeat != before.repeat:
        every = f"every {after.repeat} s" if after.repeat.isdigit() else after.repeat
        yield f"repeats: {every}" if every else "does not repeat"
    if after.label != before.label:
        yield f"label '{after.label}'" if after.label else "no label"


def _start_of(terms: Terms, at: float) -> str:
    starts = []
    if terms.start_at is not None:
        starts.append(f"start in {_seconds(terms.start_at, at)}")
    if terms.start_utc is not None:
        starts.append(f"start at {utc_text(terms.start_utc)}")
    return " and ".join(starts) or "no start time"


def _deadline_of(terms: Terms, at: float) -> str:
    if terms.start_within is not None:
        return f"deadline {terms.start_within:g} s after its start time"
    return (
        "no deadline" if terms.deadline is None else f"deadline in {_seconds(terms.deadline, at)}"
    )


def _seconds(moment: float | None, at: float) -> str:
    return f"{round((moment or 0.0) - at, 1):g} s"
