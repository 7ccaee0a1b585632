"""Exports the journal as text, JSON lines or CSV, rendered as in the log; times in UTC."""

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import starmap
from typing import Any

from mav_tasks.basics.errors import UsageError
from mav_tasks.mavlink.address import who_is
from mav_tasks.shell.logs.joined import Entry, joined
from mav_tasks.store.rendering import event_values, in_commands, utc_text
from mav_tasks.tasks.events import Event

#: events with times in UTC -> lines
LinesOf = Callable[[Iterable[Entry]], Iterator[str]]

TIMING = ("period", "count", "p50", "p99", "longest", "late")

COLUMNS = (
    "number",
    "time",
    "event",
    "vehicle",
    "task",
    "version",
    "old",
    "new",
    "reason",
    "actor",
    "words",
    # setpoint timing of a driven task, in seconds
    *TIMING,
)

#: an actor in the text of an event, and its endpoint
BY = re.compile(r"by (\d+/\d+@(\S+?)(?: signed \S+?)?)(?=[:;,]?(?:\s|$))")

_SECONDS = {"s": 1, "m": 60, "h": 3_600, "d": 86_400}

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False).encode


def text_entries(entries: Iterable[Entry]) -> Iterator[str]:
    """Yield a line of text for each change: time and message."""
    for _, event, words in joined(entries):
        yield f"{utc_text(event.at)} {for_people(words)}\n"


def for_people(words: str) -> str:
    """Return the text of an event with commands for buttons, and names for addresses."""
    return BY.sub(_by, in_commands(words))


def _by(found: re.Match[str]) -> str:
    return f"by {who_is(found[1])} at {found[2]}"


def json_entries(entries: Iterable[Entry]) -> Iterator[str]:
    return starmap(json_entry, entries)


def csv_entries(entries: Iterable[Entry]) -> Iterator[str]:
    return starmap(csv_entry, entries)


def json_entry(number: int, event: Event) -> str:
    return _encode({"number": number} | event_values(event, offset=0.0)) + "\n"


def csv_entry(number: int, event: Event) -> str:
    """Return a row of COLUMNS; a field that the event lacks is empty."""
    values = event_values(event, offset=0.0)
    # a submission has no "new" field: use the task's state
    values = {"new": values.get("state")} | values | {"number": number, "words": values["message"]}
    values |= values.get("timing") or {}
    return csv_row([values.get(column) for column in COLUMNS])


def csv_row(cells: Sequence[Any]) -> str:
    row = io.StringIO()
    csv.writer(row, lineterminator="\n").writerow(cells)
    return row.getvalue()


def parse_moment(name: str, text: str, *, now: float) -> float:
    """Return UTC seconds from a duration before ``now`` or an ISO 8601 time; raise UsageError."""
    ago = re.fullmatch(r"(\d+(?:\.\d+)?)([smhd])", text)
    if ago is not None:
        return now - float(ago[1]) * _SECONDS[ago[2]]
    try:
        moment = datetime.fromisoformat(text)
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        raise UsageError(
            f"{name} {text}: expected 30m, 2h, 7d, or a time in UTC as 2026-11-20T10:00"
        ) from None
