"""Tasks that repeat: each run of a series is a task, and its end makes the next one. Pure.

``Terms.repeat`` is a period in seconds ("3600"), or a cron expression. A period counts from the
planned start of the run before, so that it does not drift. The next run is the first planned time
in the future: times that passed meanwhile are left out, never made up for.
"""

from dataclasses import replace
from functools import lru_cache
from math import ceil
from typing import NamedTuple

from mav_tasks.tasks.cron import Cron, parse_cron
from mav_tasks.tasks.lifecycle import WAITING, TaskReason, TaskState, words_of
from mav_tasks.tasks.task import Task, Terms

R, S = TaskReason, TaskState

MIN_PERIOD = 10  # s
MAX_PERIOD = 16_777_215  # s, half a year: the whole numbers that a float32 holds exactly
MAX_REPEAT = 64  # bytes of an expression with its time zone
MOST_COUNTED = 100  # times of an expression that are left out; beyond this nobody counts them
CORRECTION = 3 * 3600.0  # s; Debian's cron follows a clock at once that was set by more than this

Rule = int | Cron


class Run(NamedTuple):
    """The terms of the run after a task's, and how many planned times were left out before it."""

    terms: Terms
    left_out: int


@lru_cache(maxsize=1024)
def rule_of(text: str) -> Rule:
    """Return the period in seconds, or the expression. Raise ValueError if it is neither."""
    if len(text.encode()) > MAX_REPEAT:
        raise ValueError(f"{text!r}: more than {MAX_REPEAT} bytes")
    if text.isascii() and text.isdigit():
        period = int(text)
        if not MIN_PERIOD <= period <= MAX_PERIOD:
            raise ValueError(f"every {period} s: expected {MIN_PERIOD} s to {MAX_PERIOD} s")
        return period
    return parse_cron(text)


def canonical(text: str) -> str:
    """Return a repetition in the form that is stored. Raise ValueError if it is invalid."""
    return str(rule_of(text))


def why_series_ends(task: Task) -> str:
    """Return why no run follows a task that has ended, in words; "": one follows.

    To end one run by a cancel, or by its failure, is not to end the series. A STOP, a kill and a
    cleared queue end it: nobody wants the rover to start by itself hours later.
    """
    if task.state is S.KILLED or task.reason in (R.CLEARED, R.DEPENDENCY_FAILED):
        return "killed" if task.reason is R.CANCELLED else words_of(task.reason)
    return ""


def repeating(task: Task, repeat: str, *, now: float, wall_offset: float) -> Terms:
    """Return a task's terms with a repetition; ``repeat`` is canonical, "" for none.

    With an expression a task that waits starts at the expression's next time, instead of its own.
    Raise ValueError if the expression has no time. ``wall_offset`` is UTC minus monotonic time, s.
    """
    terms = task.terms
    if not repeat:
        return replace(terms, repeat="")
    terms = replace(terms, repeat=repeat, series=terms.series or task.id)
    if terms.start_at is None and terms.start_utc is None:
        terms = replace(terms, start_at=task.submitted_at)
    if terms.deadline is not None:
        within = terms.deadline - _start(terms, wall_offset=wall_offset)
        terms = replace(terms, deadline=None, start_within=max(within, 0.0))
    rule = rule_of(repeat)
    if isinstance(rule, Cron) and task.state in WAITING:
        utc = rule.next(now + wall_offset)
        if utc is None:
            raise ValueError(f"{repeat!r}: never")
        terms = replace(terms, start_utc=utc, start_at=None)
    return terms


def next_run(terms: Terms, *, now: float, wall_offset: float) -> Run | None:
    """Return the run after one with these terms; None: its expression has no further time."""
    rule, planned = rule_of(terms.repeat), _start(terms, wall_offset=wall_offset)
    if isinstance(rule, Cron):
        utc = rule.next(max(planned, now) + wall_offset)
        if utc is None:
            return None
        left_out = _count(rule, planned + wall_offset, before=now + wall_offset)
        return Run(replace(terms, start_utc=utc, start_at=None), left_out)
    steps = max(int((now - planned) // rule), 0) + 1
    if terms.start_utc is not None:
        at_utc = terms.start_utc + steps * rule
        return Run(replace(terms, start_utc=at_utc, start_at=None), steps - 1)
    return Run(replace(terms, start_at=planned + steps * rule), steps - 1)


def brought_forward(terms: Terms, *, utc: float) -> Terms:
    """Return the terms of a run that waits; it starts at the first planned time after ``utc``.

    The same terms if it does so, or counts from the run before and by no clock.
    """
    if terms.start_utc is None:
        return terms
    rule = rule_of(terms.repeat)
    if isinstance(rule, Cron):
        first = rule.next(utc)
    else:
        first = terms.start_utc - max(ceil((terms.start_utc - utc) / rule) - 1, 0) * rule
    if first is None or first >= terms.start_utc:
        return terms
    return replace(terms, start_utc=first)


def _start(terms: Terms, *, wall_offset: float) -> float:
    """Return the planned start of a run, monotonic s."""
    if terms.start_utc is not None:
        return terms.start_utc - wall_offset
    assert terms.start_at is not None, "a task that repeats has a start time"
    return terms.start_at


def _count(cron: Cron, after: float, *, before: float) -> int:
    """Return how many planned times lie between two moments; at most MOST_COUNTED."""
    count, at = 0, cron.next(after)
    while at is not None and at <= before and count < MOST_COUNTED:
        count, at = count + 1, cron.next(at)
    return count


def left_out_words(count: int, repeat: str) -> str:
    """Return a number of planned times of a repetition as text."""
    if count >= MOST_COUNTED and isinstance(rule_of(repeat), Cron):
        return f"{MOST_COUNTED} or more runs"
    return "1 run" if count == 1 else f"{count} runs"
