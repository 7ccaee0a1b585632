"""Formats log records as lines of text or JSON; repeated messages are counted, not written."""

import json
import logging
import time
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import is_dataclass
from datetime import UTC, datetime
from typing import Any

from mav_tasks.basics.clock import boot_time
from mav_tasks.shell.logs.repeats import Repeats, Said
from mav_tasks.store.rendering import in_commands, utc_text, values_of
from mav_tasks.tasks.events import Event, SubmissionRefused

#: record, message, None or (number of repetitions, within s) -> the line
LineOf = Callable[[logging.LogRecord, str, tuple[int, float] | None], str]

SECONDS = len("2026-11-24T14:05:09")

_traceback = logging.Formatter().formatException
_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False).encode


class TextLines:
    """Formats lines of text: local time with zone, level, message. A traceback adds lines."""

    def __init__(self) -> None:
        self._second = -1
        # cached text of the second and its zone: thousands of lines a second have the same
        self._clock = self._zone = ""

    def __call__(
        self, record: logging.LogRecord, words: str, repeated: tuple[int, float] | None
    ) -> str:
        second = int(record.created)
        if second != self._second:
            self._second = second
            moment = datetime.fromtimestamp(second, UTC).astimezone().isoformat()
            self._clock, self._zone = moment[:SECONDS], moment[SECONDS:]
        clock = f"{self._clock}.{int(record.msecs):03}{self._zone}"
        line = f"{clock} {record.levelname} {words}"
        if repeated:
            line += _count(repeated)
        if record.exc_info:
            line = "\n".join([line, *map(in_commands, _traceback(record.exc_info).splitlines())])
        return line


def json_line(record: logging.LogRecord, words: str, repeated: tuple[int, float] | None) -> str:
    """Return one JSON object: time, level, message; for an event also its kind and fields."""
    values: dict[str, Any] = {
        "time": utc_text(record.created),
        "level": record.levelname.lower(),
        "message": words,
    }
    if is_dataclass(record.msg):
        values |= values_of(record.msg, offset=record.created - boot_time())
    if repeated:
        more, seconds = repeated
        values |= {
            "message": words + _count(repeated),
            "repeated": more,
            "within": round(seconds, 3),
        }
    if record.exc_info:
        values["traceback"] = _traceback(record.exc_info)
    return _encode(values)


class Lines:
    """Converts records to lines. ``now``: monotonic seconds; ``wall`` returns UTC seconds."""

    def __init__(self, line_of: LineOf, *, wall: Callable[[], float] = time.time) -> None:
        self._line_of = line_of
        self._wall = wall
        self._repeats: Repeats[tuple[logging.LogRecord, str]] = Repeats()

    def __repr__(self) -> str:
        return f"Lines({self._repeats})"

    def of(self, record: logging.LogRecord, *, now: float) -> str | None:
        """Return the line of a record; None if it repeats a recent message, and is counted."""
        words = in_commands(record.getMessage())
        if not _is_change(record.msg) and not self._repeats.is_new(
            (record.levelno, words), (record, words), now=now
        ):
            return None
        return self._line_of(record, words, None)

    def line(self, record: logging.LogRecord) -> str:
        """Return the line of a record, also if it repeats a message."""
        return self._line_of(record, in_commands(record.getMessage()), None)

    def due(self, *, now: float) -> Iterator[str]:
        """Return a line for each repeated message whose window is over."""
        return map(self._counted, self._repeats.due(now=now))

    def rest(self, *, now: float) -> Iterator[str]:
        """Return a line for each message with unreported repetitions, at the end of the log."""
        return map(self._counted, self._repeats.rest(now=now))

    def _counted(self, of: tuple[Said[tuple[logging.LogRecord, str]], float]) -> str:
        """Return a line with the present time: the log's lines must be in order of time."""
        said, seconds = of
        record, words = copy(said.what[0]), said.what[1]
        record.created = self._wall()
        record.msecs = record.created % 1 * 1000
        return self._line_of(record, words, (said.more, seconds))


def _is_change(message: object) -> bool:
    """Whether a message is an event that changed something: it is news even if the text repeats."""
    return isinstance(message, Event) and not isinstance(message, SubmissionRefused)


def _count(repeated: tuple[int, float]) -> str:
    more, seconds = repeated
    return f" (repeated {more} times in {seconds:.0f} s)"
