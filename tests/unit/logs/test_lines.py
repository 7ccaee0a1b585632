"""Lines of a log: for people and for machines."""

import json
import logging
import sys

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
        "INFO command 54000 of 255/190@a refused: too many",
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
    assert said["message"] == "link x lost (2 more in 30 s)"
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


def test_a_text_line_is_as_loggings_own() -> None:
    own = logging.Formatter("%(asctime)s %(levelname)s %(message)s")
    lines = TextLines()
    for created in (1.0, 1_790_000_000.123, 1_790_000_000.9, 1_790_000_001.0):
        it = record("words %d", 3)
        it.created, it.msecs = created, created % 1 * 1000
        assert lines(it, it.getMessage(), None) == own.format(it)


def test_words_of_more_than_one_line_become_one() -> None:
    assert lines_of(record("a\nb \x1b[2J")) == ["INFO a b [2J"]
