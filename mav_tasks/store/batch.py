"""Events as the rows of one transaction. Pure: rows are made once, and reused for each retry."""

from collections.abc import Sequence
from typing import Any

from mav_tasks.store.codec import Encoder, dumps
from mav_tasks.tasks.events import (
    Event,
    ParameterSet,
    PlanStored,
    QueueContinued,
    QueuePaused,
    SignaturesSeen,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskProgressed,
    TaskSubmitted,
    TaskWithdrawn,
    VehicleArmingSet,
    VehicleHalted,
    VehicleIdentified,
    VehicleSpeedSet,
)
from mav_tasks.tasks.halts import BY_SOMEBODY
from mav_tasks.tasks.task import Task, following


class Batch:
    """Rows of events, numbered from ``first`` over the life of the store.

    A submission becomes a row of ``tasks``, and none of ``journal``. Of several changes of one task
    only the last updates its row in ``tasks``.
    """

    def __init__(
        self,
        events: Sequence[Event],
        *,
        first: int,
        encoder: Encoder,
        format_id: int,
        offset: float,
    ) -> None:
        self.first = first
        self.last = first + len(events) - 1
        self.next_id: int | None = None  # after the last submitted task; None: no submission
        self.tasks: list[tuple[Any, ...]] = []  # id, number, vehicle, state, changed_at, submitted
        self.journal: list[tuple[Any, ...]] = []  # number, utc, kind, task_id, vehicle, body
        self.changed: dict[int, tuple[Any, ...]] = {}  # state, changed_at, changed, id
        self.modified: dict[int, tuple[Any, ...]] = {}  # modified, id
        self.advanced: dict[int, tuple[Any, ...]] = {}  # advanced, id
        self.run_after: dict[int, tuple[int, int]] = {}  # the task before it, 0: none; id
        self.assigned: dict[int, tuple[Any, ...]] = {}  # vehicle, assigned, id
        #: of submissions to any vehicle: by key, system, component and nonce -> payload, task id
        self.nonces: dict[tuple[Any, ...], tuple[str, int]] = {}
        self.withdrawn: list[tuple[int]] = []
        self.plans: dict[tuple[int, int], tuple[Any, ...]] = {}  # vehicle, kind, plan_id, source
        self.parameters: dict[str, tuple[Any, ...]] = {}  # name, value
        self.vehicles: dict[tuple[str, int], Any] = {}  # column and vehicle -> value
        #: key, link, system, component -> timestamp, None: forgotten
        self.signatures: dict[tuple[Any, ...], int | None] = {}
        self.signed_until = 0
        for number, event in enumerate(events, first):
            if isinstance(event, SignaturesSeen):
                self._note_signatures(event)
                continue
            if isinstance(event, TaskProgressed):  # stored as a TaskAdvanced in the task's row only
                kept = TaskAdvanced(
                    event.task_id, event.vehicle, event.version, event.progress, event.at
                )
                row = [format_id, *encoder.row(kept, offset=offset)]
                self.advanced[event.task_id] = (dumps(row), event.task_id)
                continue
            row = encoder.row(event, offset=offset)
            row.insert(0, format_id)
            body = dumps(row)
            if type(event) is TaskSubmitted:
                task = event.task
                self.next_id = following(task.id)
                if task.terms.after:
                    self.run_after[task.id] = (task.terms.after, task.id)
                self.tasks.append(
                    (task.id, number, task.vehicle, task.state, event.at + offset, body)
                )
                self._note_nonce(task)
            else:
                self._note(event, number, body, event.at + offset)

    def __repr__(self) -> str:
        return f"Batch({self.first} to {self.last})"

    def _note_signatures(self, event: SignaturesSeen) -> None:
        for time in (*event.times, *event.gone):
            sender = (time.key, time.link_id, time.system_id, time.component_id)
            self.signatures[sender] = time.timestamp or None
        self.signed_until = max(self.signed_until, event.signed_until)

    def _note_nonce(self, task: Task) -> None:
        if task.choice and task.marks.nonce:
            who, marks = task.submitter, task.marks
            place = who.fingerprint, who.system_id, who.component_id, marks.nonce
            self.nonces[place] = marks.payload, task.id

    def _note(self, event: Event, number: int, body: str, utc: float) -> None:
        task_id = getattr(event, "task_id", None)
        vehicle = getattr(event, "vehicle", None)
        self.journal.append((number, utc, type(event).__name__, task_id, vehicle, body))
        match event:
            case TaskChanged():
                self.changed[event.task_id] = (event.new, utc, body, event.task_id)
            case TaskModified():
                self.modified[event.task_id] = (body, event.task_id)
                if event.before is None or event.before.after != event.terms.after:
                    self.run_after[event.task_id] = (event.terms.after, event.task_id)
            case TaskAdvanced():
                self.advanced[event.task_id] = (body, event.task_id)
            case TaskAssigned(before=before) if before:
                self.assigned[event.task_id] = (event.vehicle, body, event.task_id)
            case TaskWithdrawn():
                self.withdrawn.append((event.task_id,))
                kept = self.nonces.items()
                self.nonces = {place: of for place, of in kept if of[1] != event.task_id}
            case QueuePaused():
                self.vehicles["paused", event.vehicle] = event.reason
            case QueueContinued():
                self.vehicles["paused", event.vehicle] = None
                self.vehicles["halt_reason", event.vehicle] = None
                self.vehicles["halted_utc", event.vehicle] = None
            case VehicleHalted():
                self.vehicles["halt_epoch", event.vehicle] = event.epoch
                if event.reason in BY_SOMEBODY:
                    self.vehicles["halt_reason", event.vehicle] = event.reason
                    self.vehicles["halted_utc", event.vehicle] = utc
            case VehicleIdentified():
                self.vehicles["uid", event.vehicle] = event.uid
            case PlanStored():
                row = (event.vehicle, event.kind, event.plan_id, event.source)
                self.plans[event.vehicle, event.kind] = row
            case ParameterSet():
                self.parameters[event.name] = (event.name, event.value)
            case VehicleArmingSet():
                self.vehicles["may_arm", event.vehicle] = int(event.may_arm)
            case VehicleSpeedSet():
                self.vehicles["speed", event.vehicle] = event.speed
