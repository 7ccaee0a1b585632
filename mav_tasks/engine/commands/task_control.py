"""Commands on existing tasks: cancel, clear, modify, release, change speed.

Each returns the id of the task that it acted on, 0 for none or many, or raises Rejection.
"""

from dataclasses import replace

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.rights import OPERATOR
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.commands.goals import MAX_DELAY, flag, identifier, number, whole
from mav_tasks.engine.policy import row_of_message
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity, TaskProperty
from mav_tasks.mavlink.label import MAX_LABEL, Piece, with_piece
from mav_tasks.mavlink.messages import CommandCancel
from mav_tasks.services.command_receiver import Command
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import MAX_PRIORITY, Task, Terms

R, P = TaskReason, TaskProperty

AGAIN, REMAINDER, SKIP = range(3)  # TASK_RELEASE, param2
NO_CHANGE, DEFAULT = -1.0, -2.0  # DO_CHANGE_SPEED, param2
GROUND_OR_AIR = 1  # DO_CHANGE_SPEED, highest param1: airspeed counts as ground speed


class TaskControl:
    """The commands of clients on existing tasks."""

    def __init__(self, registry: TaskRegistry) -> None:
        self._registry = registry

    def act(self, asked: CommandRequest, *, now: float) -> int:
        """Execute one of these commands; return the task's id, or 0."""
        match asked.command.command:
            case MavCmd.TASK_CANCEL:
                return self._cancel(asked, now=now)
            case MavCmd.TASK_CLEAR:
                return self._clear(asked, now=now)
            case MavCmd.TASK_MODIFY:
                return self._modify(asked, now=now)
            case MavCmd.TASK_RELEASE:
                return self._release(asked, now=now)
            case _:
                return self._change_speed(asked, now=now)

    def cancel_latest(
        self, client: GcsClient, vehicle: Vehicle, source: Address, command: int, *, now: float
    ) -> None:
        """COMMAND_CANCEL: cancel a client's latest task of a command, if it is not over.

        A message that waited while the server was stalled leaves a held task as it is. There is no
        acknowledgement; the task's status shows the effect.
        """
        submitter = client.submitter(source)
        task = self._registry.latest(submitter, command, vehicle=vehicle.system_id)
        if task is None or (client.is_late and task.state is TaskState.HELD):
            return
        if client.rights.reach(row_of_message(CommandCancel.id).role):
            vehicle.joint.cancel(task, kill=False, actor=str(submitter), now=now)

    def _cancel(self, asked: CommandRequest, *, now: float) -> int:
        """Cancel one task. A copy gets the answer of the first, and cancels no other task."""
        first = asked.receiver.answer_to_counted_copy(asked.command, now=now)
        if first is not None and first.result == MavResult.ACCEPTED:
            return first.result_param2
        if first is not None:
            raise Rejection(R(first.result_param2), "just refused; send it again if you mean it")
        task_id = identifier(asked.command, 1, "task", default=None)
        kill = flag(asked.command, 2, "kill")
        active = asked.vehicle.tasks.active
        if task_id == 0 and active is None:
            raise Rejection(R.NOT_FOUND, "no task is running")
        task = active if task_id == 0 and active is not None else self._find(asked, task_id)
        asked.rights.require_own(task, asked.submitter, "cancel")
        if asked.client.is_late and task.state is TaskState.HELD:  # other tasks would start
            words = f"delayed by the server; task {task.id} is held now: cancel it again"
            raise Rejection(R.STALE, words)
        asked.vehicle.joint.cancel(task, kill=kill, actor=asked.actor, now=now)
        return task.id

    def _clear(self, asked: CommandRequest, *, now: float) -> int:
        begun_too = flag(asked.command, 1, "scope")
        asked.vehicle.joint.clear(begun_too=begun_too, actor=asked.actor, now=now)
        return 0

    def _release(self, asked: CommandRequest, *, now: float) -> int:
        """Release or skip a held task. A copy has no effect on a task held since the first."""
        copy = asked.receiver.answer_to_copy(asked.command, now=now)
        if copy is not None:
            done = "skipped" if asked.command.params[1] == SKIP else "released"
            asked.tell(f"task {copy.result_param2}: already {done}", MavSeverity.INFO, now=now)
            return copy.result_param2
        task_id = identifier(asked.command, 1, "task", default=None)
        how = whole(asked.command, 2, "how", high=SKIP, default=None)
        active = asked.vehicle.tasks.active
        if task_id == 0 and (active is None or active.state is not TaskState.HELD):
            raise Rejection(R.NOT_FOUND, "no task is held")
        task = active if task_id == 0 and active is not None else self._find(asked, task_id)
        asked.rights.require_own(task, asked.submitter, "release")
        if task.state is not TaskState.HELD:
            raise Rejection(R.WRONG_STATE, f"task {task.id} is not held, it is {_words(task)}")
        if how == SKIP:
            asked.vehicle.joint.skip(task, actor=asked.actor, now=now)
        else:
            may_continue = asked.rights.reach(OPERATOR)
            asked.vehicle.joint.release(
                task, again=how == AGAIN, may_continue=may_continue, actor=asked.actor, now=now
            )
        return task.id

    def _modify(self, asked: CommandRequest, *, now: float) -> int:
        task = self._find(asked, identifier(asked.command, 1, "task", low=1, default=None))
        asked.rights.require_own(task, asked.submitter, "modify")
        terms = _modified(task, asked.command, now=now)
        if terms.priority > task.terms.priority:
            asked.rights.check_priority(terms.priority)
        if terms.is_preemptive and not task.terms.is_preemptive:
            asked.rights.check_preemptive()
        asked.vehicle.tasks.modify(task, terms, actor=asked.actor, now=now)
        return task.id

    def _change_speed(self, asked: CommandRequest, *, now: float) -> int:
        whole(asked.command, 1, "speed type", high=GROUND_OR_AIR)
        wish = asked.command.params[1]
        if wish == NO_CHANGE:
            return 0
        driving = asked.vehicle.parts.settings.driving
        top = min(driving.max_speed, asked.rights.limits.max_speed)
        speed = None if wish == DEFAULT else number(asked.command, 2, "speed", low=0.01, high=top)
        return asked.vehicle.tasks.set_speed(speed, actor=asked.actor, now=now) or 0

    def _find(self, asked: CommandRequest, task_id: int) -> Task:
        task = self._registry.get(task_id)
        if task is None:
            raise Rejection(R.NOT_FOUND, f"no task {task_id}")
        if task.vehicle != asked.vehicle.system_id:
            raise Rejection(R.NOT_FOUND, f"task {task_id} belongs to rover {task.vehicle}")
        if task.state in TERMINAL:
            raise Rejection(R.WRONG_STATE, f"task {task_id} has ended ({_words(task)})")
        return task


def _words(task: Task) -> str:
    return task.state.name.lower()


def _modified(task: Task, command: Command, *, now: float) -> Terms:
    """Return a task's terms with one property changed."""
    terms = task.terms
    wanted = whole(command, 2, "property", low=1, high=max(P), default=None)
    if task.state not in WAITING and wanted in _OF_WAITING:
        words = f"task {task.id} has started: {P(wanted).name} can no longer change"
        raise Rejection(R.WRONG_STATE, words)
    match wanted:
        case P.PRIORITY:
            return replace(
                terms, priority=whole(command, 3, "priority", high=MAX_PRIORITY, default=None)
            )
        case P.START_DELAY:
            delay = number(command, 3, "start delay", low=0.0, high=MAX_DELAY)
            return replace(terms, start_at=now + delay if delay else None, start_utc=None)
        case P.DEADLINE:
            deadline = number(command, 3, "deadline", low=0.0, high=MAX_DELAY)
            return replace(terms, deadline=now + deadline if deadline else None)
        case P.RUN_AFTER:
            return replace(terms, after=identifier(command, 3, "run after", default=None))
        case P.PREEMPTIBLE:
            return replace(terms, is_preemptible=flag(command, 3, "pre-emptible", default=None))
        case P.PREEMPTIVE:
            return replace(terms, is_preemptive=flag(command, 3, "pre-emptive", default=None))
        case P.LABEL:
            return replace(terms, label=_label(terms.label, command))
        case _:
            return replace(terms, start_at=None, start_utc=_utc(command))


_OF_WAITING = frozenset({P.START_DELAY, P.DEADLINE, P.RUN_AFTER, P.START_UTC})


def _label(label: str, command: Command) -> str:
    """Return the label with the piece in a command put in."""
    if command.frame is None:
        raise Rejection(R.BAD_PARAMETER, "LABEL must be sent as COMMAND_INT")
    offset = whole(command, 3, "byte", high=MAX_LABEL, default=None)
    x, y = int(command.params[4]), int(command.params[5])
    try:
        return with_piece(label, Piece(offset, x, y))
    except ValueError as error:
        raise Rejection(R.BAD_PARAMETER, str(error), param=5) from None


def _utc(command: Command) -> int:
    if command.frame is None:
        raise Rejection(R.BAD_PARAMETER, "START_UTC must be sent as COMMAND_INT")
    return whole(command, 5, "UTC", low=1, high=0x7FFFFFFF, default=None)
