"""Commands on existing tasks: cancel, clear, modify, release, change speed.

Each returns the id of the task that it acted on, 0 for none or many, or raises Rejection.
"""

from dataclasses import fields, replace
from functools import partial

from mav_tasks.basics.errors import Rejection
from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.rights import OPERATOR
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.policy import row_of_message
from mav_tasks.engine.services.commands import COPIED, REPEATED, Command
from mav_tasks.engine.timers import Effect, leave_it
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds.params import flag, identifier, number, whole
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity, TaskProperty
from mav_tasks.mavlink.label import MAX_LABEL, Piece, with_piece
from mav_tasks.mavlink.messages import CommandCancel
from mav_tasks.tasks.events import SERVER
from mav_tasks.tasks.lifecycle import TERMINAL, WAITING, TaskReason, TaskState
from mav_tasks.tasks.pending_tasks import PendingTasks
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.repetition import MAX_PERIOD, MAX_REPEAT, canonical, repeating
from mav_tasks.tasks.task import MAX_DELAY, MAX_PRIORITY, Task, TaskId, Terms
from mav_tasks.tasks.times import Times

R, P = TaskReason, TaskProperty

AGAIN, REMAINDER, SKIP = range(3)  # TASK_RELEASE, param2
NO_CHANGE, DEFAULT = -1.0, -2.0  # DO_CHANGE_SPEED, param2
MOST_BEGUN = 64  # repetitions of which some pieces have come
GROUND_OR_AIR = 1  # DO_CHANGE_SPEED, highest param1: airspeed counts as ground speed


class TaskControl:
    """The commands of clients on existing tasks."""

    def __init__(self, registry: TaskRegistry) -> None:
        self._registry = registry
        self._begun: dict[TaskId, str] = {}  # the pieces of each task's repetition so far

    def act(self, asked: CommandRequest, *, now: float) -> int:
        """Execute one of these commands; return the task's id, or 0."""
        match asked.command.command:
            case MavCmd.TASK_CANCEL:
                return self._cancel(asked, now=now)
            case MavCmd.TASK_CLEAR:
                return self._clear(asked, now=now)
            case _:
                return self._release(asked, now=now)

    def change(self, asked: CommandRequest, *, now: float) -> tuple[TaskId, Effect]:
        """Execute TASK_MODIFY or DO_CHANGE_SPEED; return the task's id, and what undoes it."""
        if asked.command.command == MavCmd.TASK_MODIFY:
            return self._modify(asked, now=now)
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
        """Cancel one task, or a series. A copy gets the first one's answer, and cancels no other.

        The id of any run names its series, whose present run is cancelled, too.
        """
        is_counted = asked.command.confirmation > 0
        earlier = asked.earlier(within=COPIED, now=now) if is_counted else ()
        first = next((each.answer for each in earlier if each.answer is not None), None)
        if first is not None and first.result == MavResult.ACCEPTED:
            return first.result_param2
        if first is not None:
            raise Rejection(R(first.result_param2), "just refused; send it again if you mean it")
        task_id = identifier(asked.command, 1, "task", default=None)
        kill, is_series = flag(asked.command, 2, "kill"), flag(asked.command, 3, "series")
        active = asked.vehicle.tasks.active
        if task_id == 0 and active is None:
            raise Rejection(R.NOT_FOUND, "no task is running")
        task_id = active.id if task_id == 0 and active is not None else task_id
        run = self._run_of(task_id) if is_series else task_id
        task = self._find(asked, run, may_be_over=is_series and run in self._registry.unplanned)
        asked.rights.require_own(task, asked.submitter, "cancel")
        if asked.client.is_late and task.state is TaskState.HELD:  # other tasks would start
            words = f"delayed by the server; task {task.id} is held now: cancel it again"
            raise Rejection(R.STALE, words)
        if is_series:
            self._cancel_series(asked, task, kill=kill, actor=asked.actor, now=now)
        else:
            asked.vehicle.joint.cancel(task, kill=kill, actor=asked.actor, now=now)
        return task.id

    def _cancel_series(
        self, asked: CommandRequest, task: Task, *, kill: bool, actor: str, now: float
    ) -> None:
        """Cancel the present run of a series, and let no further one follow."""
        if task.state in TERMINAL:  # between two runs
            self._registry.repeat_no_more(task.id, actor=actor, now=now)
            return
        terms = replace(task.terms, repeat="")
        asked.vehicle.tasks.modify(task, terms, actor=actor, now=now)
        task = self._registry[task.id]
        asked.vehicle.joint.cancel(task, kill=kill, actor=actor, now=now)

    def _run_of(self, task_id: int) -> int:
        """Return the present run of a series, or the last one, by the id of any of its runs."""
        named = self._registry.get(task_id)
        series = named.terms.series if named is not None else task_id
        run = self._registry.run_of(series)
        if run is None and named is not None:
            raise Rejection(R.WRONG_STATE, f"task {task_id} does not repeat")
        return task_id if run is None else run

    def _clear(self, asked: CommandRequest, *, now: float) -> int:
        begun_too = flag(asked.command, 1, "scope")
        asked.vehicle.joint.clear(begun_too=begun_too, actor=asked.actor, now=now)
        return 0

    def _release(self, asked: CommandRequest, *, now: float) -> int:
        """Release or skip a held task. A copy has no effect on a task held since the first."""
        copies = asked.earlier(within=REPEATED, now=now)
        copy = next((each.answer for each in copies if each.is_accepted), None)
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

    def _modify(self, asked: CommandRequest, *, now: float) -> tuple[TaskId, Effect]:
        task = self._find(asked, identifier(asked.command, 1, "task", low=1, default=None))
        asked.rights.require_own(task, asked.submitter, "modify")
        room = asked.vehicle.tasks.room
        if asked.command.params[1] == P.REPEAT:
            terms = self._with_piece(task, asked.command, room.times, now=now)
        else:
            terms = _modified(task, asked.command, room, now=now)
        asked.rights.check_terms(terms, before=task.terms)
        asked.vehicle.tasks.modify(task, terms, actor=asked.actor, now=now)
        return task.id, partial(self._not_modified, asked, task, terms)

    def _not_modified(
        self, asked: CommandRequest, before: Task, after: Terms, *, now: float
    ) -> None:
        """Undo a modification, but no term that something else has changed since.

        What repeats by it may have ended meanwhile: then its next run waits.
        """
        task = self._registry.get(self._registry.run_of(after.series) or before.id)
        if task is None:
            return
        is_over, old = task.id != before.id or task.state in TERMINAL, before.terms
        names = ["repeat"] if is_over else [field.name for field in fields(Terms)]
        terms = {
            name: getattr(old, name)
            for name in names
            if getattr(old, name) != getattr(after, name) == getattr(task.terms, name)
        }
        if is_over and terms == {"repeat": ""}:
            self._cancel_series(asked, task, kill=False, actor=SERVER, now=now)
            return
        try:
            asked.vehicle.tasks.modify(task, replace(task.terms, **terms), actor=SERVER, now=now)
        except Rejection:  # what it ran after has failed meanwhile
            asked.vehicle.joint.cancel(
                task, kill=False, reason=R.DEPENDENCY_FAILED, actor=SERVER, now=now
            )

    def _with_piece(self, task: Task, command: Command, times: Times, *, now: float) -> Terms:
        """Return a task's terms with a piece of its repetition; unchanged until all have come."""
        size = whole(command, 4, "bytes", low=1, high=MAX_REPEAT, default=None)
        text = _with_piece(self._begun.get(task.id, ""), command, "repeat", most=MAX_REPEAT)
        # also when all have come: the last one may come twice
        keep_latest(self._begun, task.id, text, most=MOST_BEGUN)
        if len(text.encode()) < size:
            return task.terms
        return _repeating(task, text, times, now=now)

    def _change_speed(self, asked: CommandRequest, *, now: float) -> tuple[TaskId, Effect]:
        whole(asked.command, 1, "speed type", high=GROUND_OR_AIR)
        wish = asked.command.params[1]
        if wish == NO_CHANGE:
            return TaskId(0), leave_it
        top = min(asked.vehicle.parts.settings.driving.max_speed, asked.rights.limits.max_speed)
        speed = None if wish == DEFAULT else number(asked.command, 2, "speed", low=0.01, high=top)
        tasks = asked.vehicle.tasks
        undo = partial(tasks.reset_speed, tasks.active, tasks.speed, instead_of=speed)
        return tasks.set_speed(speed, actor=asked.actor, now=now) or TaskId(0), undo

    def _find(self, asked: CommandRequest, task_id: int, *, may_be_over: bool = False) -> Task:
        task = self._registry.get(task_id)
        if task is None:
            raise Rejection(R.NOT_FOUND, f"no task {task_id}")
        if task.vehicle != asked.vehicle.system_id:
            raise Rejection(R.NOT_FOUND, f"task {task_id} belongs to rover {task.vehicle}")
        if task.state in TERMINAL and not may_be_over:
            raise Rejection(R.WRONG_STATE, f"task {task_id} has ended ({_words(task)})")
        return task


def _words(task: Task) -> str:
    return task.state.name.lower()


def _modified(task: Task, command: Command, room: PendingTasks, *, now: float) -> Terms:
    """Return a task's terms with one property changed."""
    terms = task.terms
    wanted = whole(command, 2, "property", low=1, high=max(P), default=None)
    is_of_next = wanted == P.DEADLINE and terms.repeat  # of the next run, too
    if task.state not in WAITING and wanted in _OF_WAITING and not is_of_next:
        words = f"task {task.id} has started: {P(wanted).name} can no longer change"
        raise Rejection(R.WRONG_STATE, words)
    match wanted:
        case P.PRIORITY:
            priority = whole(command, 3, "priority", high=MAX_PRIORITY, default=None)
            return replace(terms, priority=priority, place=None)
        case P.RUN_BEFORE:
            other = identifier(command, 3, "run before", default=None)
            place = room.queue(task.vehicle).place_before(other)
            if place is None:
                raise Rejection(R.WRONG_STATE, f"task {other} is not in this queue")
            return replace(terms, place=place)
        case P.START_DELAY:
            delay = number(command, 3, "start delay", low=0.0, high=MAX_DELAY)
            return replace(terms, start_at=now + delay if delay else None, start_utc=None)
        case P.DEADLINE:
            deadline = number(command, 3, "deadline", low=0.0, high=MAX_DELAY)
            if terms.repeat:
                return replace(terms, deadline=None, start_within=deadline or None)
            return replace(terms, deadline=now + deadline if deadline else None, start_within=None)
        case P.EVERY:
            period = whole(command, 3, "every", high=MAX_PERIOD, default=None)
            return _repeating(task, str(period) if period else "", room.times, now=now)
        case P.RUN_AFTER:
            return replace(terms, after=identifier(command, 3, "run after", default=None))
        case P.PREEMPTIBLE:
            return replace(terms, is_preemptible=flag(command, 3, "pre-emptible", default=None))
        case P.PREEMPTIVE:
            return replace(terms, is_preemptive=flag(command, 3, "pre-emptive", default=None))
        case P.LABEL:
            return replace(terms, label=_with_piece(terms.label, command, "label", most=MAX_LABEL))
        case _:
            return replace(terms, start_at=None, start_utc=_utc(command))


_OF_WAITING = frozenset({P.START_DELAY, P.DEADLINE, P.RUN_AFTER, P.RUN_BEFORE, P.START_UTC})


def _repeating(task: Task, text: str, times: Times, *, now: float) -> Terms:
    """Return a task's terms with a repetition; "": none."""
    if task.terms.is_staged:
        raise Rejection(R.WRONG_STATE, f"task {task.id} needs a start command: it cannot repeat")
    try:
        repeat = canonical(text) if text else ""
        if repeat == task.terms.repeat:  # a copy: the task may have moved on
            return task.terms
        return repeating(task, repeat, now=now, wall_offset=times.wall_offset)
    except ValueError as error:
        raise Rejection(R.BAD_PARAMETER, str(error), param=3) from None


def _with_piece(text: str, command: Command, name: str, *, most: int) -> str:
    """Return a text with the piece in a command put in."""
    if command.frame is None:
        raise Rejection(R.BAD_PARAMETER, f"{name.upper()} must be sent as COMMAND_INT")
    offset = whole(command, 3, "byte", high=most, default=None)
    x, y = int(command.params[4]), int(command.params[5])
    try:
        return with_piece(text, Piece(offset, x, y), name=name, most=most)
    except ValueError as error:
        raise Rejection(R.BAD_PARAMETER, str(error), param=5) from None


def _utc(command: Command) -> int:
    if command.frame is None:
        raise Rejection(R.BAD_PARAMETER, "START_UTC must be sent as COMMAND_INT")
    return whole(command, 5, "UTC", low=1, high=0x7FFFFFFF, default=None)
