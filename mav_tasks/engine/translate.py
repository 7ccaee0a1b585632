"""Where MAVLink and tasks meet: commands become drafts, tasks become messages. Pure functions."""

from math import degrees, isfinite, isnan, nan, radians

from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame, MavResult, MavSeverity
from mav_tasks.services.command_receiver import Command
from mav_tasks.settings import Driving
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    QueuePaused,
    TaskChanged,
    TaskWaits,
    VehicleNoted,
    VehicleSeen,
)
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of
from mav_tasks.tasks.task import (
    DEFAULT_PRIORITY,
    MAX_PRIORITY,
    MAX_TASK_ID,
    Draft,
    Goal,
    Move,
    Rotate,
    Submitter,
    Task,
    describe,
)
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R = TaskReason

#: the wire answer of each refusal; what is not listed is DENIED
RESULT_OF: dict[int, MavResult] = {
    R.QUEUE_FULL: MavResult.TEMPORARILY_REJECTED,
    R.QUOTA: MavResult.TEMPORARILY_REJECTED,
    R.STORE_UNAVAILABLE: MavResult.TEMPORARILY_REJECTED,
    R.RATE_LIMITED: MavResult.TEMPORARILY_REJECTED,
    R.STOPPED: MavResult.TEMPORARILY_REJECTED,
    R.OTHER_CONTROLLER: MavResult.TEMPORARILY_REJECTED,
    R.WRONG_MODE: MavResult.TEMPORARILY_REJECTED,
    R.NO_POSITION: MavResult.TEMPORARILY_REJECTED,
    R.DISARMED: MavResult.TEMPORARILY_REJECTED,
    R.VEHICLE_SILENT: MavResult.FAILED,
    R.NOT_SUPPORTED_BY_VEHICLE: MavResult.UNSUPPORTED,
}

#: what the person who reads that a task waits may do about it
WAITS_FOR = {
    R.VEHICLE_SILENT: "the rover is silent",
    R.OTHER_CONTROLLER: "somebody else drives",
    R.WRONG_MODE: "wrong mode, set HOLD",
    R.NO_POSITION: "no position",
    R.DISARMED: "disarmed; arm, or continue",
}

UNIT_METRES = 1  # TASK_UNIT
UNIT_RADIANS = 2
UNKNOWN_POSITION = 65535
UNKNOWN_PROGRESS = 255

#: a COMMAND_INT may name any frame there is: the numbers of our commands are not coordinates
KNOWN_FRAMES = frozenset(MavFrame)


def result_of(reason: int) -> MavResult:
    """Give the MAV_RESULT that a refusal is acknowledged with."""
    return RESULT_OF.get(reason, MavResult.DENIED)


def draft_of(command: Command, vehicle: int, submitter: Submitter, driving: Driving) -> Draft:
    """Give the task that TASK_MOVE or TASK_ROTATE asks for; Rejection names a bad parameter."""
    if command.frame is not None and command.frame not in KNOWN_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {command.frame} is unknown")
    _refuse_not_yet(command)
    return Draft(
        vehicle=vehicle,
        command=command.command,
        goal=_goal_of(command, driving),
        priority=_priority_of(command),
        submitter=submitter,
        nonce=nonce_of(command),
    )


def nonce_of(command: Command) -> int:
    """Give a submission's nonce, 0 for none."""
    return round(_number(command, 4, "nonce", low=0, high=MAX_TASK_ID, default=0.0, whole=True))


def task_status(
    task: Task,
    tasks: VehicleTasks,
    *,
    reader: Address,
    link_number: int,
    with_position: bool,
    now: float,
) -> m.TaskStatus:
    """Give the TASK_STATUS of a task of this vehicle, for the client at ``reader``."""
    reason = tasks.wait_reason(task)
    position = tasks.position(task) if with_position else None
    return m.TaskStatus(
        time_boot_ms=round(now * 1000) & 0xFFFFFFFF,
        task_id=task.id,
        version=task.version,
        nonce=task.nonce,
        after_task_id=0,
        remaining=task.remaining,
        time_to_start=nan,
        time_to_finish=nan,
        execution_time=nan if task.progress.anchor is None else task.progress.execution_time,
        command=task.command,
        queue_position=UNKNOWN_POSITION if position is None else position,
        step=0,
        step_count=1,
        target_system=reader.system_id,
        target_component=reader.component_id,
        state=task.state,
        reason=reason,
        priority=task.priority,
        progress=_progress(task),
        remaining_unit=UNIT_METRES if isinstance(task.goal, Move) else UNIT_RADIANS,
        submitter_system=task.submitter.system_id,
        submitter_component=task.submitter.component_id,
        submitter_link=link_number,
        text=_words(task, reason).encode()[:50],
    )


def queue_status(
    tasks: VehicleTasks, counts: list[int], *, version: int, now: float
) -> m.TaskQueueStatus:
    """Give the TASK_QUEUE_STATUS of a vehicle; ``counts`` are its tasks by TASK_STATE."""
    begun = tasks.begun
    waiting = tasks.waiting
    return m.TaskQueueStatus(
        time_boot_ms=round(now * 1000) & 0xFFFFFFFF,
        version=version & 0xFFFFFFFF,
        running_id=0 if begun is None else begun.id,
        next_id=waiting[0] if waiting else 0,
        capacity=tasks.capacity,
        counts=counts,
        paused_reason=tasks.paused,
        flags=0,
    )


def text_of(event: Event) -> tuple[int, MavSeverity, str] | None:
    """Give (vehicle, severity, words) for the people at ground stations, or None."""
    match event:
        case TaskChanged(new=TaskState.EXECUTING):
            return event.vehicle, MavSeverity.INFO, f"Task {event.task_id} started"
        case TaskChanged(new=TaskState.COMPLETED):
            return event.vehicle, MavSeverity.NOTICE, f"Task {event.task_id} done"
        case TaskChanged(new=TaskState.FAILED | TaskState.HELD as new, reason=reason):
            text = f"Task {event.task_id} {new.name.lower()}: {words_of(reason)}"
            return event.vehicle, MavSeverity.ERROR, text
        case TaskChanged(new=TaskState.PAUSED | TaskState.KILLED | TaskState.CANCELLED as new):
            text = f"Task {event.task_id} {new.name.lower()}: {words_of(event.reason)}"
            return event.vehicle, MavSeverity.NOTICE, text
        case TaskWaits(task_id=task_id, reason=reason):
            return event.vehicle, MavSeverity.NOTICE, f"Task {task_id} waits: {WAITS_FOR[reason]}"
        case QueuePaused(reason=TaskReason.STOPPED):
            return event.vehicle, MavSeverity.WARNING, "STOP: nothing runs until continued"
        case QueuePaused():
            return event.vehicle, MavSeverity.NOTICE, f"Queue paused: {words_of(event.reason)}"
        case QueueContinued():
            return event.vehicle, MavSeverity.INFO, "Queue continued"
        case VehicleSeen(text=text):
            return event.vehicle, MavSeverity.INFO, f"Vehicle {event.vehicle} {text}"
        case VehicleNoted(text=text):
            return event.vehicle, MavSeverity.WARNING, f"Vehicle {event.vehicle} {text}"
    return None


def message_id_of(command: Command) -> int:
    """Give the message id in param1 of REQUEST_MESSAGE and its kind; -1 for nonsense."""
    return _whole(command.params[0])


def task_id_of(command: Command) -> int:
    """Give the task id in param2 of REQUEST_MESSAGE(TASK_STATUS); -1 for nonsense."""
    return _whole(command.params[1])


def first_index_of(command: Command) -> int:
    """Give the first index in param3 of REQUEST_MESSAGE(TASK_STATUS, 0); -1 for nonsense."""
    return _whole(command.params[2])


def _whole(value: float) -> int:
    return int(value) if isfinite(value) and value == int(value) and value >= 0 else -1


def _goal_of(command: Command, driving: Driving) -> Goal:
    if command.command == MavCmd.TASK_MOVE:
        distance = _number(
            command, 1, "distance", low=-driving.max_distance, high=driving.max_distance
        )
        speed = _number(command, 2, "speed", low=0.0, high=driving.max_speed, default=0.0)
        if distance == 0.0:
            raise Rejection(R.BAD_PARAMETER, "param1 distance is 0: nothing to do")
        return Move(distance, speed or None)
    turn = degrees(driving.max_turn)
    angle = _number(command, 1, "angle", low=-turn, high=turn)
    rate = _number(command, 2, "rate", low=0.0, high=degrees(driving.max_turn_rate), default=0.0)
    if angle == 0.0:
        raise Rejection(R.BAD_PARAMETER, "param1 angle is 0: nothing to do")
    return Rotate(radians(angle), radians(rate) or None)


def _priority_of(command: Command) -> int:
    return round(
        _number(
            command,
            7,
            "priority",
            low=0,
            high=MAX_PRIORITY,
            default=float(DEFAULT_PRIORITY),
            whole=True,
        )
    )


def _refuse_not_yet(command: Command) -> None:
    """What this version cannot honour is refused, never left out in silence."""
    for index, name in ((3, "(unused)"), (5, "run after"), (6, "start delay")):
        value = command.params[index - 1]
        if not (isnan(value) or value == 0.0):
            raise Rejection(R.BAD_PARAMETER, f"param{index} {name}: must be 0 in this version")


def _number(
    command: Command,
    index: int,
    name: str,
    *,
    low: float,
    high: float,
    default: float | None = None,
    whole: bool = False,
) -> float:
    """Give a parameter, or raise a Rejection that names it. NaN is "not given"."""
    value = command.params[index - 1]
    if low <= value <= high and not (whole and value != int(value)):
        return value
    label = f"param{index} {name}"
    if not isnan(value):
        fault = "is not a whole number" if low <= value <= high else f"not in {low:.8g}..{high:.8g}"
        raise Rejection(R.BAD_PARAMETER, f"{label} {value:.8g} {fault}")
    if default is None:
        raise Rejection(R.BAD_PARAMETER, f"{label} is not given")
    return default


def _progress(task: Task) -> int:
    if task.state is TaskState.COMPLETED:
        return 100
    if task.progress.anchor is None:
        return 0
    return round(100 * min(1.0, max(0.0, task.progress.done / task.length)))


def _words(task: Task, reason: TaskReason) -> str:
    state = task.state.name.lower()
    return f"{describe(task.goal)}: {state}" + (f" ({words_of(reason)})" if reason else "")
