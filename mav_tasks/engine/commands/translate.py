"""Converts tasks and events to messages: results, statuses, texts. Pure functions.

``goals`` converts commands to tasks.
"""

from math import isfinite, nan

from mav_tasks.config.settings import SET_FAILSAFE
from mav_tasks.engine.services.commands import Command
from mav_tasks.kinds import GoTo, Leg, Unit
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address, who_is
from mav_tasks.mavlink.enums import MavResult, MavSeverity
from mav_tasks.mavlink.float_param import EXACT, large_number
from mav_tasks.mavlink.special_values import (
    NO_HEARTBEAT,
    SHARES_ID,
    UNKNOWN_POSITION,
)
from mav_tasks.tasks.driving.estimate import time_left
from mav_tasks.tasks.driving.mission_sequencer import present_goal
from mav_tasks.tasks.events import (
    SERVER,
    Event,
    QueueContinued,
    QueuePaused,
    TaskAssigned,
    TaskChanged,
    TaskWaits,
    VehicleNoted,
    VehicleSeen,
)
from mav_tasks.tasks.forecast import Forecast, estimate, known_of, position, wait_reason
from mav_tasks.tasks.goal import Goal, Plan
from mav_tasks.tasks.lifecycle import TERMINAL, TaskReason, TaskState, words_of
from mav_tasks.tasks.task import Progress, Task
from mav_tasks.tasks.timing import Timing
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R = TaskReason


TWIN_FOR = 10.0  # s for which the other one is told of after its last heartbeat

#: results of a command that has halted a vehicle; FAILED: it is silent, or the halt is not kept
IN_FORCE = (MavResult.ACCEPTED, MavResult.FAILED)
#: MAV_RESULT of each refusal reason; DENIED for all others
RESULT_OF: dict[int, MavResult] = {
    R.QUEUE_FULL: MavResult.TEMPORARILY_REJECTED,
    R.QUOTA: MavResult.TEMPORARILY_REJECTED,
    R.STORE_UNAVAILABLE: MavResult.TEMPORARILY_REJECTED,
    R.RATE_LIMITED: MavResult.TEMPORARILY_REJECTED,
    R.STALE: MavResult.TEMPORARILY_REJECTED,
    R.STOPPED: MavResult.TEMPORARILY_REJECTED,
    R.HELD_AHEAD: MavResult.TEMPORARILY_REJECTED,
    R.QUEUE_PAUSED: MavResult.TEMPORARILY_REJECTED,
    R.OTHER_CONTROLLER: MavResult.TEMPORARILY_REJECTED,
    R.WRONG_MODE: MavResult.TEMPORARILY_REJECTED,
    R.NO_POSITION: MavResult.TEMPORARILY_REJECTED,
    R.DISARMED: MavResult.TEMPORARILY_REJECTED,
    R.LOSS_FAILSAFE: MavResult.TEMPORARILY_REJECTED,
    R.NOT_READY: MavResult.TEMPORARILY_REJECTED,
    R.VEHICLE_SILENT: MavResult.FAILED,
}

#: texts why a task waits, and what a person can do about it
WAITS_FOR = {
    R.VEHICLE_SILENT: "the rover is silent",
    R.OTHER_CONTROLLER: "another controller drives it",
    R.WRONG_MODE: "wrong mode; set HOLD, press Continue",
    R.QUEUE_PAUSED: "released; press Continue to start it",
    R.NO_POSITION: "no valid position",
    R.DISARMED: "disarmed; arm it or press Continue",
    R.NOT_READY: "the rover is not ready to arm",
    R.OUTSIDE_OWN_FENCE: "outside its own fence; drive it back by hand",
    R.LOSS_FAILSAFE: f"it might drive on without setpoints; {SET_FAILSAFE}",
}

#: reasons to wait or stop that somebody asked for, or that need no action: told as INFO
CALM = frozenset(
    {
        R.VEHICLE_SILENT,  # a warning was sent already
        R.OTHER_CONTROLLER,
        R.NO_POSITION,
        R.NOT_READY,
        R.QUEUE_PAUSED,
        R.TAKEOVER,  # a warning was sent already
        R.FAILSAFE,
        R.OPERATOR,
        R.PREEMPTED,
        R.CANCELLED,
        R.CLEARED,
        R.REPLACED,
        R.SKIPPED,
        R.STOP,
    }
)

STATES = tuple(state.name.lower() for state in TaskState)  # names, by number


FLOAT32_MAX = 3.4e38
LAST_POSITION = 65534  # this or a later position: a queue may be longer than the field allows
TEXT = 50  # bytes of TASK_STATUS.text


def result_of(reason: int) -> MavResult:
    """Return the MAV_RESULT for a refusal reason."""
    return RESULT_OF.get(reason, MavResult.DENIED)


def task_status(
    task: Task,
    tasks: VehicleTasks,
    *,
    reader: Address,
    link_number: int,
    forecast: Forecast | None,
    now: float,
) -> m.TaskStatus:
    """Return the TASK_STATUS of a task of this vehicle, for the client at ``reader``.

    ``forecast``: of the vehicle's tasks; None to leave out its queue position and forecast times.
    """
    reason = wait_reason(tasks, task)
    ahead = position(tasks, task) if forecast is not None else None
    to_start, to_finish = estimate(tasks, task, forecast=forecast, now=now)
    progress, submitter = task.progress, task.submitter
    says = tasks.executor.waits_for[1] if tasks.executor.task_id == task.id else ""
    unit, left = _left(task, tasks)
    words = _words(task, reason, says)
    step, step_count = _steps(task.goal, progress)
    return m.TaskStatus(
        time_boot_ms=round(now * 1000) & 0xFFFFFFFF,
        task_id=task.id,
        version=task.version,
        nonce=task.marks.nonce,
        after_task_id=task.terms.after,
        remaining=left,
        time_to_start=to_start if abs(to_start) < FLOAT32_MAX else nan,
        time_to_finish=to_finish if abs(to_finish) < FLOAT32_MAX else nan,
        execution_time=nan if progress.anchor is None else progress.execution_time,
        command=task.command,
        queue_position=UNKNOWN_POSITION if ahead is None else min(ahead, LAST_POSITION),
        step=step,
        step_count=step_count,
        target_system=reader.system_id,
        target_component=reader.component_id,
        state=task.state,
        reason=reason,
        priority=task.terms.priority,
        progress=100 if task.state is TaskState.COMPLETED else round(100 * progress.share),
        remaining_unit=unit,
        submitter_system=submitter.system_id,
        submitter_component=submitter.component_id,
        submitter_link=link_number,
        text=words.encode()[:TEXT].decode(errors="ignore").encode(),  # whole characters
        halt_epoch=tasks.halts.epoch & 0xFFFFFFFF,
        label=task.terms.label.encode(),
        series=task.terms.series,
        repeat=task.terms.repeat.encode(),
    )


def task_timing(
    task: Task, timing: Timing | None, *, period: float, reader: Address, now: float
) -> m.TaskTiming:
    """Return the TASK_TIMING of a task; ``period`` is that of its vehicle's setpoints, in s."""
    return m.TaskTiming(
        time_boot_ms=round(now * 1000) & 0xFFFFFFFF,
        task_id=task.id,
        count=0 if timing is None else timing.count,
        late=0 if timing is None else timing.late,
        rate=1 / (period if timing is None else timing.period),
        p50=nan if timing is None else timing.p50,
        p99=nan if timing is None else timing.p99,
        longest=nan if timing is None else timing.longest,
        target_system=reader.system_id,
        target_component=reader.component_id,
    )


def queue_status(
    tasks: VehicleTasks,
    counts: list[int],
    *,
    heard_at: float | None,
    gateway: bytes,
    version: int,
    now: float,
) -> m.TaskQueueStatus:
    """Return the TASK_QUEUE_STATUS of a vehicle; ``counts`` are its tasks by TASK_STATE.

    ``heard_at``: time of its last heartbeat, None if it was not heard in this run.
    ``gateway``: the name of this server in its fleet.
    """
    active = tasks.active
    age = NO_HEARTBEAT
    if heard_at is not None:
        age = min(max(1, round((now - heard_at) * 1000)), NO_HEARTBEAT - 1)
    return m.TaskQueueStatus(
        time_boot_ms=round(now * 1000) & 0xFFFFFFFF,
        version=version & 0xFFFFFFFF,
        running_id=0 if active is None else active.id,
        next_id=tasks.queue.first() or 0,
        capacity=tasks.settings.queueing.capacity,
        counts=counts,
        paused_reason=tasks.paused,
        flags=SHARES_ID * (now - tasks.twin_heard_at < TWIN_FOR),
        halt_epoch=tasks.halts.epoch & 0xFFFFFFFF,
        heartbeat_age=age,
        gateway=gateway,
    )


def text_of(event: Event) -> tuple[int, MavSeverity, str] | None:
    """Return (vehicle, severity, text) for people at ground stations, or None.

    INFO: it went as requested. WARNING and ERROR: somebody should act.
    """
    match event:
        case TaskChanged(new=TaskState.EXECUTING):
            return event.vehicle, MavSeverity.INFO, f"Task {event.task_id} started"
        case TaskChanged(new=TaskState.COMPLETED):
            return event.vehicle, MavSeverity.INFO, f"Task {event.task_id} done"
        case TaskChanged(new=TaskState.HELD, reason=reason):
            text = f"Task {event.task_id} held: {words_of(reason)}. Press a Held button"
            return event.vehicle, MavSeverity.ERROR, text
        case TaskChanged(new=TaskState.FAILED | TaskState.EXPIRED as new, reason=reason):
            text = f"Task {event.task_id} {new.name.lower()}: {words_of(reason)}"
            return event.vehicle, MavSeverity.ERROR, text
        case TaskChanged(
            new=TaskState.KILLED | TaskState.CANCELLED as new,
            reason=TaskReason.CANCELLED | TaskReason.STOP,
        ):
            how = "stopped for good" if new is TaskState.KILLED else "cancelled"
            text = f"Task {event.task_id} {how}{_by(event.actor)}"
            return event.vehicle, _severity(event.reason), text
        case TaskChanged(new=TaskState.PAUSED, reason=TaskReason.OPERATOR):
            text = f"Task {event.task_id} paused{_by(event.actor)}"
            return event.vehicle, _severity(event.reason), text
        case TaskChanged(new=TaskState.PAUSED | TaskState.KILLED | TaskState.CANCELLED as new):
            text = f"Task {event.task_id} {new.name.lower()}: {words_of(event.reason)}"
            return event.vehicle, _severity(event.reason), text
        case TaskAssigned(before=before, choice=choice) if before:  # else ``Submissions`` tells
            text = f"Task {event.task_id} is now rover {event.vehicle}'s: {choice}"
            return event.vehicle, MavSeverity.WARNING, text
        case TaskWaits(task_id=task_id, reason=reason):
            words = f": {event.words}" if event.words else ""
            text = f"Task {task_id} waits: {WAITS_FOR.get(reason) or words_of(reason)}{words}"
            return event.vehicle, _severity(reason), text
        case QueuePaused(reason=TaskReason.STOPPED):
            text = f"STOP{_by(event.actor)}: press Continue to resume"
            return event.vehicle, MavSeverity.WARNING, text
        case QueuePaused(reason=TaskReason.OPERATOR as reason):
            return event.vehicle, _severity(reason), f"Queue paused{_by(event.actor)}"
        case QueuePaused(reason=reason):
            text = f"Queue paused: {words_of(reason)}. Press Continue"
            return event.vehicle, _severity(reason), text
        case QueueContinued():
            return event.vehicle, MavSeverity.INFO, f"Queue resumed{_by(event.actor)}"
        case VehicleSeen(text=text):
            return event.vehicle, MavSeverity.INFO, f"Rover {event.vehicle} {text}"
        case VehicleNoted(text=text):
            return event.vehicle, MavSeverity.WARNING, f"Rover {event.vehicle} {text}"
    return None


def _by(actor: str) -> str:
    return "" if actor == SERVER else f" by {who_is(actor)}"


def _severity(reason: TaskReason) -> MavSeverity:
    """Return the severity of a text that a task or queue waits or stops for this reason.

    QGroundControl shows NOTICE and worse in red, and its megaphone stays a warning triangle.
    """
    return MavSeverity.INFO if reason in CALM else MavSeverity.WARNING


def message_id_of(command: Command) -> int:
    """Return the message id in param1 of REQUEST_MESSAGE and similar commands; -1 if invalid."""
    return whole_of(command.params[0])


def task_id_of(command: Command) -> int:
    """Return the task id in param2 of REQUEST_MESSAGE for task messages; -1 if invalid."""
    large = large_number(command.params[1])
    number = whole_of(command.params[1]) if large is None else large
    return number if large is not None or number <= EXACT else -1


def whole_of(value: float) -> int:
    """Return a parameter that is a number from 0 on; -1 if it is invalid."""
    return int(value) if isfinite(value) and value == int(value) and value >= 0 else -1


def _left(task: Task, tasks: VehicleTasks) -> tuple[Unit, float]:
    """Return how much is left, and its unit: the way to a place or of a plan, else the leg."""
    if isinstance(task.goal, GoTo | Plan) and task.progress.anchor and task.state not in TERMINAL:
        way = time_left(task.goal, task.progress, known_of(tasks)).metres
        if way > 0.0:
            return Unit.METRES, way if way < FLOAT32_MAX else nan
    goal = present_goal(task.goal, task.progress)
    if task.progress.anchor is not None:
        leg = goal.leg_of(task.progress)
    elif isinstance(goal, Leg):
        leg = goal
    else:
        return Unit.NONE, nan  # the size of its first leg is not known before it starts
    return leg.unit, max(0.0, leg.length - task.progress.done)


def _steps(goal: Goal, progress: Progress) -> tuple[int, int]:
    """Return the present item of a plan, or else the present leg; and the number of them."""
    if isinstance(goal, Plan):
        count = goal.item_count
        step = goal.item_number(goal.present_step(progress.step)) - 1
        return min(max(step, 0), max(count - 1, 0)), count
    return progress.leg, goal.leg_count


def _words(task: Task, reason: TaskReason, says: str) -> str:
    """Return a task, its state and reason as text; ``says``: the vehicle's own text on it."""
    label = f" '{task.terms.label}'" if task.terms.label else ""
    words = f"{task.goal.words}{label}: {STATES[task.state]}"
    if not reason:
        return words
    return f"{words} ({words_of(reason)}: {says})" if says else f"{words} ({words_of(reason)})"
