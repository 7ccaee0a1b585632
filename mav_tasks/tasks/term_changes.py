"""What a modification changed in the terms of a task, as text: "priority 9 (was 5)". Pure."""

from collections.abc import Iterator

from mav_tasks.tasks.cron import utc_text
from mav_tasks.tasks.repetition import repeat_words
from mav_tasks.tasks.task import Terms


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
    if after.is_preemptible != before.is_preemptible:
        yield "pre-emptible" if after.is_preemptible else "not pre-emptible"
    if after.is_preemptive != before.is_preemptive:
        yield "pre-emptive" if after.is_preemptive else "not pre-emptive"
    if after.is_staged != before.is_staged:
        yield "needs a start command" if after.is_staged else "start command received"
    if after.repeat != before.repeat:
        yield f"repeats: {repeat_words(after.repeat)}" if after.repeat else "does not repeat"
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
