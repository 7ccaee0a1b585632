"""Renders events as text and as plain values, for the log and for the export of the journal.

Values come from the event's fields, not from its text. An enum is rendered as its name, a time as
UTC, NaN and infinity as null. Fields for internal use are left out.
"""

import logging
import re
from collections.abc import Hashable
from dataclasses import fields, is_dataclass
from datetime import UTC, datetime
from enum import Enum
from functools import cache, lru_cache
from math import isfinite
from types import NoneType
from typing import Any, cast

from mav_tasks.kinds import Place
from mav_tasks.store.codec import MONOTONIC
from mav_tasks.tasks.events import (
    Event,
    QueuePaused,
    SignatureRefused,
    SignaturesSeen,
    SubmissionRefused,
    TaskChanged,
    TaskProgressed,
    TaskSubmitted,
    VehicleHalted,
    VehicleNoted,
)
from mav_tasks.tasks.goal import Goal
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Submitter, Task

#: dedup keys, a plan's items as received, the histogram of intervals, and times that the line has
#: itself
_LEFT_OUT = frozenset({"at", "submitted_at", "marks", "source", "spread"})
_NAMES = {"task_id": "task", "submitter": "actor"}
#: a field may hold one of several of these classes: their values tell which
_CHOICES = frozenset((*Goal.__args__, *Place.__args__))

#: what texts for ground stations tell people to press, and the command for it
_BUTTONS = (
    (re.compile(r"[Pp]ress Continue"), "run 'mav-tasks resume'"),
    (
        re.compile(r'[Pp]ress (a Held button( for each held task)?|"?Held: [\w:", ]*skip"?)'),
        "run 'mav-tasks release again|remainder|skip'",
    ),
    (re.compile(r"then Continue"), "then 'mav-tasks resume'"),
)

#: of the events that are not logged as information
_LEVELS: dict[type, int] = {
    **dict.fromkeys((SignaturesSeen, TaskProgressed, VehicleHalted), logging.DEBUG),
    **dict.fromkeys((SubmissionRefused, SignatureRefused, VehicleNoted), logging.WARNING),
}  # DEBUG: other events tell the operator enough

_PLAIN = frozenset({int, str, bool, NoneType})


def values_of(event: Any, *, offset: float) -> dict[str, Any]:
    """Return the values of an event, or of another logged dataclass, its class name first.

    ``offset`` is UTC minus the clock of the event's times, s.
    """
    values = {"event": type(event).__name__}
    if isinstance(event, TaskSubmitted):
        return values | _of_task(event.task, offset)
    return values | _values(event, offset)


def event_values(event: Event, *, offset: float) -> dict[str, Any]:
    """Return the values of an event's JSON line, as in the log."""
    line = {
        "time": utc_text(event.at + offset),
        "level": logging.getLevelName(level_of(event)).lower(),
        "message": in_commands(str(event)),
    }
    return line | values_of(event, offset=offset)


def level_of(event: Event) -> int:
    """Return the log level of an event: a warning if the operator should look at it."""
    match event:
        case TaskChanged(new=TaskState.FAILED | TaskState.HELD | TaskState.EXPIRED):
            return logging.WARNING
        case QueuePaused(reason=reason) if reason is not TaskReason.OPERATOR:
            return logging.WARNING
    return _LEVELS.get(type(event), logging.INFO)


def utc_text(utc: float) -> str | None:
    """Return UTC seconds as ISO 8601 with milliseconds; None if they are not representable."""
    if not isfinite(utc):
        return None
    second, rest = divmod(round(utc * 1e6), 1_000_000)
    text = _utc_second(second)
    return text and f"{text}.{rest // 1000:03}Z"


def in_commands(words: str) -> str:
    """Return a text on one line with the commands that do what a ground station's buttons do."""
    words = clean(words)
    if "ress " not in words:  # nearly always
        return words
    for button, done in _BUTTONS:
        words = button.sub(done, words)
    return words


def clean(words: str) -> str:
    """Return a text on one line and without terminal control characters.

    Clients and vehicles may have sent parts of it.
    """
    if words.isprintable():
        return words
    return "".join(c if c.isprintable() else " " if c.isspace() else "" for c in words)


@lru_cache(16)  # thousands of events share a second
def _utc_second(second: int) -> str | None:
    try:
        return datetime.fromtimestamp(second, UTC).isoformat()[:19]
    except (ValueError, OverflowError, OSError):  # out of datetime's range
        return None


def _of_task(task: Task, offset: float) -> dict[str, Any]:
    values = {"task": task.id} | _values(task, offset)
    del values["id"], values["progress"], values["timing"]  # a new task has none
    return values


def _values(record: Any, offset: float) -> dict[str, Any]:
    return {
        shown: _value(getattr(record, name), name, offset)
        for name, shown in _shown(cast(Hashable, type(record)))
    }


@cache
def _shown(kind: Hashable) -> tuple[tuple[str, str], ...]:
    names = [field.name for field in fields(cast(Any, kind)) if field.name not in _LEFT_OUT]
    return tuple((name, _NAMES.get(name, name)) for name in names)


def _value(value: Any, name: str, offset: float) -> Any:
    if type(value) in _PLAIN:
        return value
    if isinstance(value, float):
        if name in MONOTONIC:
            return utc_text(value + offset)
        return value if isfinite(value) else None
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Submitter):
        return str(value)
    if is_dataclass(value):
        kind = {"kind": type(value).__name__} if type(value) in _CHOICES else {}
        return kind | _values(value, offset)
    # a plan may have thousands of steps: their number is enough
    return len(value) if any(map(is_dataclass, value)) else list(value)
