"""Tasks, queues and rovers as the command line shows them, with the commands that help. Pure."""

from math import inf

from mav_tasks.cli.times import format_duration, spoken_duration
from mav_tasks.client.descriptions import (
    end_of,
    is_of_last_save,
    left,
    remedy_for,
    remedy_for_pause,
    state_of,
    what_of,
    why_of,
)
from mav_tasks.client.fleet_view import SILENT_AFTER
from mav_tasks.client.values import QueueStatus, TaskStatus, TaskTiming
from mav_tasks.tasks.lifecycle import TaskReason, TaskState, words_of

#: reasons of waiting tasks that start without an operator's action
COMES_BY_ITSELF = (
    TaskReason.NONE,
    TaskReason.START_TIME,
    TaskReason.DEPENDENCY,
    TaskReason.BEHIND_OTHERS,
    TaskReason.WAITING_FOR_START,
)


def time_of(seconds: float | None) -> str:
    """Return an expected duration as text; "unknown" for None."""
    return "unknown" if seconds is None else spoken_duration(seconds)


def starts_of(status: TaskStatus) -> str:
    """Return the time until a waiting task starts; "" for other tasks."""
    return time_of(status.time_to_start) if status.is_waiting else ""


def every_of(status: TaskStatus) -> str:
    """Return when a task repeats: "every 1h", or a cron expression; "" if it does not."""
    if isinstance(status.every, int):
        return f"every {format_duration(status.every)}"
    return status.every or ""


def ends_of(status: TaskStatus) -> str:
    """Return the time until a task ends; "" if it has ended."""
    return "" if status.is_over else time_of(status.time_to_finish)


def took_of(status: TaskStatus) -> str:
    """Return how long a task was driven; "" if it was not driven."""
    return format_duration(status.execution_time) if status.execution_time else ""


def resume_command(rover: int, *, is_alone: bool) -> str:
    """Return the command that resumes a rover; it names the rover unless ``is_alone``."""
    return f"mav-tasks resume{_option_of(rover, is_alone=is_alone)}"


def way_on_of(status: TaskStatus, *, is_alone: bool = True) -> str:
    """Return what a person can do about a task that waits, with the command; "" if nothing.

    ``is_alone``: the server has one rover, which commands need not name.
    """
    is_decided = status.reason < TaskReason.OUTCOME_UNKNOWN  # released already, waits to start
    if status.state is TaskState.HELD and not is_decided:
        return f"release it: mav-tasks release {status.id} again|remainder|skip"
    if status.is_over:
        return ""
    option = _option_of(status.vehicle, is_alone=is_alone)
    remedy = remedy_for(
        status.reason,
        resume=_use(status.vehicle, is_alone=is_alone),
        release=f": mav-tasks release again|remainder|skip{option}",
        rover=option,
    )
    return _clause(remedy)


def line_of(status: TaskStatus, *, is_alone: bool = True) -> str:
    why = f" ({end_of(status)})" if end_of(status) else ""
    took = f", in {took_of(status)}" if status.is_over and took_of(status) else ""
    way_on = way_on_of(status, is_alone=is_alone)
    way_on = f"; {way_on}" if way_on else ""
    what = f"{name_of(status)}: {described(status)}"
    return f"{what}: {state_of(status)}{why}{took}{way_on}"


def described(status: TaskStatus) -> str:
    """Return what a task does, with its label: "move 5 m 'patrol'"."""
    return f"{what_of(status)} '{status.label}'" if status.label else what_of(status)


def name_of(status: TaskStatus) -> str:
    """Return the name of a task: "rover 1: task 3"."""
    return f"rover {status.vehicle}: task {status.id}"


def starts_by_itself(status: TaskStatus) -> bool:
    """Return whether a task has started, or starts without a person's action."""
    return not status.is_waiting or status.reason in COMES_BY_ITSELF


def why_it_waits(status: TaskStatus, queue: QueueStatus, *, is_alone: bool = True) -> str:
    """Return why a new task does not start, and what to do; "" if it starts by itself."""
    if starts_by_itself(status):
        return ""
    why, way_on = obstacle_of(status, queue, is_alone=is_alone)
    text = f"{name_of(status)} waits: {why}"
    return f"{text}; {way_on}" if way_on else text


def obstacle_of(status: TaskStatus, queue: QueueStatus, *, is_alone: bool) -> tuple[str, str]:
    """Return what a waiting task waits for, and what a person can do about it."""
    current = queue.current
    if current is not None and current.state is TaskState.HELD:
        way_on = way_on_of(current, is_alone=is_alone)
        return f"task {current.id} is held ({why_of(current)})", way_on
    if queue.paused is not None:
        way_on = way_to_resume(queue, queue.paused, is_alone=is_alone)
        return f"the queue is paused ({words_of(queue.paused)})", way_on
    return why_of(status), way_on_of(status, is_alone=is_alone)


def percent_of(status: TaskStatus) -> str:
    """Return how much of a task is done, in percent."""
    if status.progress is None:
        return ""
    percent = f"{status.progress * 100:.0f} %"
    return f"at least {percent}" if is_of_last_save(status) else percent


def left_of(status: TaskStatus) -> str:
    """Return the remainder of a task: "1.10 m"."""
    amount, unit = left(status)
    if amount is None or unit is None or status.is_over:
        return ""
    digits = {"m": 2, "items": 0}.get(unit, 1)
    words = f"{amount:.{digits}f} {unit}"
    return f"at most {words}" if is_of_last_save(status) else words


def silence_of(heartbeat_age: float | None) -> str:
    """Return how long a rover has been silent; "" if it is heard, or if that is unknown."""
    if heartbeat_age is None or heartbeat_age <= SILENT_AFTER:
        return ""
    if heartbeat_age == inf:
        return "not heard since the server started"
    return f"silent for {format_duration(heartbeat_age)}"


def headline_of(queue: QueueStatus, *, is_alone: bool = True) -> str:
    """Return what a rover does, what blocks its queue, and what a person can do about it."""
    if queue.current is not None:
        does = f"task {queue.current.id} {state_of(queue.current)}"
        does += f" ({why_of(queue.current)})" if queue.current.reason else ""
    elif queue.running is not None:
        does = f"task {queue.running}"
    else:
        does = "no task runs"
    stuck = blocked(queue)
    if stuck is not None and stuck is not queue.current:
        does += f"; task {stuck.id} waits: {why_of(stuck)}"
    if stuck is not None:
        does += f"; {way_on_of(stuck, is_alone=is_alone)}"
    if queue.paused is not None:
        does += f"; queue paused ({words_of(queue.paused)})"
        does += f"; {way_to_resume(queue, queue.paused, is_alone=is_alone)}"
    gateway = f"gateway {queue.gateway}" if queue.gateway else ""
    about = ", ".join(filter(None, (gateway, silence_of(queue.heartbeat_age))))
    rover = f"rover {queue.vehicle} ({about})" if about else f"rover {queue.vehicle}"
    return f"{rover}: {does}; {queue.waiting_count} waiting"


def blocked(queue: QueueStatus) -> TaskStatus | None:
    """Return the held task, else a task that a person can help, unless the queue is paused."""
    current = queue.current
    if current is not None and current.state is TaskState.HELD and way_on_of(current):
        return current
    if queue.paused is not None:
        return None
    first = queue.waiting[:1] if current is None else (current,)
    return next((e for e in first if e.reason not in COMES_BY_ITSELF and way_on_of(e)), None)


def way_to_resume(queue: QueueStatus, reason: TaskReason, *, is_alone: bool = True) -> str:
    """Return what a person can do about a queue that is paused for a reason."""
    return _clause(remedy_for_pause(reason, resume=_use(queue.vehicle, is_alone=is_alone)))


def _use(rover: int, *, is_alone: bool) -> str:
    return f"use: {resume_command(rover, is_alone=is_alone)}"


def _clause(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:].removesuffix(".")


def _option_of(rover: int, *, is_alone: bool) -> str:
    return "" if is_alone else f" --vehicle {rover}"


def counts_of(queue: QueueStatus) -> str:
    """Return the number of tasks in each state."""
    return ", ".join(f"{count} {state.name.lower()}" for state, count in queue.counts.items())


def timing_of(timing: TaskTiming | None) -> str:
    """Return how evenly a task's setpoints left; "" if there were none."""
    if timing is None or timing.p50 is None or timing.p99 is None or timing.max is None:
        return ""
    return (
        f"{timing.count} at {timing.rate:g} Hz: p50 {timing.p50 * 1e3:.1f},"
        f" p99 {timing.p99 * 1e3:.1f}, max {timing.max * 1e3:.1f} ms, {timing.late} late"
    )
