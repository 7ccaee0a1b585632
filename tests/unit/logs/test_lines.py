"""Lines of a log: for people and for machines."""

import json
import logging
import sys
import time

import pytest

from mav_tasks.logs.lines import Lines, TextLines, json_line
from mav_tasks.tasks.events import QueuePaused, SubmissionRefused, VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason


def record(message: object, *arguments: object, level: int = logging.INFO) -> logging.LogRecord:
    return logging.LogRecord("mav_tasks", level, "", 0, message, arguments, None)


def lines_of(*records: logging.LogRecord) -> list[str | None]:
    lines = Lines(lambda record, words, repeated: f"{record.levelname} {words}")
    return [lines.of(each, now=0.0) for each in records]


def test_the_same_words_are_said_once() -> None:
    store = record("store %s: disk full", "x", level=logging.ERROR)
    other = record("store y: disk full", level=logging.ERROR)
    refused = record(SubmissionRefused(1, 54000, TaskReason.QUOTA, "too many", "255/190@a", 1.0))
    again = record(SubmissionRefused(1, 54000, TaskReason.QUOTA, "too many", "255/190@a", 2.0))
    assert lines_of(store, store, other, refused, again) == [
        "ERROR store x: disk full",
        None,
        "ERROR store y: disk full",
        "INFO rover 1: command 54000 by 255/190@a refused: too many",
        None,
    ]


def test_a_change_is_news_each_time() -> None:
    """Between two stops of the same words somebody continued."""
    stop = record(QueuePaused(1, TaskReason.STOPPED, "a", 1.0))
    lost = record(VehicleNoted(1, "silent", 1.0))
    assert None not in lines_of(stop, stop, lost, lost)


def test_the_count_is_a_line_with_words_and_numbers() -> None:
    lines = Lines(json_line)
    for now in (0.0, 1.0, 2.0):
        lines.of(record("link x lost"), now=now)
    assert list(lines.due(now=29.0)) == []
    (line,) = lines.due(now=30.0)
    said = json.loads(line)
    assert said["message"] == "link x lost (repeated 2 times in 30 s)"
    assert (said["repeated"], said["within"], said["level"]) == (2, 30.0, "info")


def failed() -> logging.LogRecord:
    try:
        raise ZeroDivisionError("\x1b]0;title\x07")
    except ZeroDivisionError:
        it = record("internal error", level=logging.CRITICAL)
        it.exc_info = sys.exc_info()
        return it


def test_a_traceback_is_in_both_and_gives_no_orders() -> None:
    text = TextLines()(failed(), "internal error", None)
    assert text.splitlines()[0].endswith("CRITICAL internal error")
    assert text.splitlines()[-1] == "ZeroDivisionError: ]0;title"
    (line,) = json_line(failed(), "internal error", None).splitlines()
    assert "ZeroDivisionError" in json.loads(line)["traceback"]


@pytest.mark.parametrize(
    ("zone", "second", "expected"),
    [
        ("UTC0", 1_790_000_000.125, "2026-09-21T14:13:20.125+00:00"),
        ("CET-1CEST,M3.5.0,M10.5.0/3", 1_790_000_000.9, "2026-09-21T16:13:20.900+02:00"),
        ("NST3:30NDT,M3.2.0,M11.1.0", 1.0, "1969-12-31T20:30:01.000-03:30"),
    ],
)
def test_a_text_line_has_local_time_and_its_zone(
    monkeypatch: pytest.MonkeyPatch, zone: str, second: float, expected: str
) -> None:
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        it = record("words %d", 3)
        it.created, it.msecs = second, second % 1 * 1000
        assert TextLines()(it, it.getMessage(), None) == f"{expected} INFO words 3"
    finally:
        monkeypatch.undo()
        time.tzset()


def test_a_count_has_the_time_at_which_it_is_written() -> None:
    """With the time of the first it stood after later lines, and the log was out of order."""
    lines = Lines(json_line, wall=lambda: 1_790_000_031.5)
    for now in (0.0, 1.0):
        it = record("link x lost")
        it.created = 1_790_000_000.0 + now
        lines.of(it, now=now)
    (line,) = lines.due(now=31.5)
    assert json.loads(line)["time"] == "2026-09-21T14:13:51.500Z"


def test_words_of_more_than_one_line_become_one() -> None:
    assert lines_of(record("a\nb \x1b[2J")) == ["INFO a b [2J"]
