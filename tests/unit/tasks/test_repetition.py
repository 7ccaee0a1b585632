"""When a task that repeats runs next: periods, cron expressions, daylight saving time."""

from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.tasks.cron import Cron, parse_cron, utc_text
from mav_tasks.tasks.repetition import (
    MAX_PERIOD,
    MAX_REPEAT,
    brought_forward,
    canonical,
    left_out_words,
    next_run,
    repeating,
    rule_of,
)
from mav_tasks.tasks.task import Marks, Task, TaskId, Terms
from tests.unit.tasks.samples import FORWARD_2, SOMEBODY, TASK_MOVE

HOUR, DAY = 3600, 86_400
OFFSET = 1_800_000_000.0  # s, UTC minus monotonic
ZURICH = ZoneInfo("Europe/Zurich")
HOURLY = Terms(repeat=str(HOUR), series=1, start_at=100.0)


def task(terms: Terms, submitted_at: float = 100.0) -> Task:
    return Task(TaskId(1), 1, TASK_MOVE, FORWARD_2, SOMEBODY, Marks(), submitted_at, terms)


def utc(text: str, zone: ZoneInfo | None = None) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=zone or UTC).timestamp()


def times(text: str, *, after: float, count: int) -> list[str]:
    """Return the next times of an expression, in UTC."""
    cron, found = parse_cron(text), list[str]()
    for _ in range(count):
        at = cron.next(after)
        assert at is not None
        assert at > after
        found.append(utc_text(at).removesuffix(" UTC"))
        after = at
    return found


def test_a_period_counts_from_the_planned_start_and_leaves_out_what_has_passed() -> None:
    starts = [
        (run.terms.start_at, run.left_out)
        for now in (100.0, 3699.9, 3700.0, 90_000.0)
        if (run := next_run(HOURLY, now=now, wall_offset=OFFSET)) is not None
    ]
    assert starts == [(3700.0, 0), (3700.0, 0), (7300.0, 1), (90_100.0, 24)]
    for text, words in (("60", "2777 runs"), ("* * * * *", "100 or more runs")):
        terms = Terms(repeat=text, start_utc=int(OFFSET))
        run = next_run(terms, now=166_650.0, wall_offset=OFFSET)
        assert run is not None
        assert left_out_words(run.left_out, text) == words
    never = Terms(repeat="* * */20 * 1L", start_utc=1)
    assert next_run(never, now=0.0, wall_offset=OFFSET) is None


def test_an_expression_is_read_in_its_zone() -> None:
    after = utc("2026-11-26T05:30")
    assert times("0 6 * * 1-5", after=after, count=3) == [
        "2026-11-26 06:00",
        "2026-11-27 06:00",
        "2026-11-30 06:00",
    ]
    assert times("0 6 * * 1-5 Europe/Zurich", after=after, count=1) == ["2026-11-27 05:00"]


def test_where_summer_time_begins_a_run_in_the_hour_left_out_comes_just_after_it() -> None:
    """Zurich, 2027-03-28: 02:00 becomes 03:00."""
    after = utc("2027-03-27T12:00", ZURICH)
    assert times("30 2 * * * Europe/Zurich", after=after, count=2) == [
        "2027-03-28 01:00",  # 03:00 there
        "2027-03-29 00:30",
    ]
    hourly = times("0 * * * * Europe/Zurich", after=utc("2027-03-28T00:00"), count=2)
    assert hourly == ["2027-03-28 01:00", "2027-03-28 02:00"]


def test_where_summer_time_ends_a_run_in_the_hour_that_comes_twice_runs_once() -> None:
    """Zurich, 2026-10-25: 03:00 becomes 02:00."""
    text, first = "30 2 * * * Europe/Zurich", utc("2026-10-25T00:30")
    assert parse_cron(text).next(first - 60) == first
    # also if the first of them ends within the second hour
    for later in (0.0, 40 * 60, 59.5 * 60, 61 * 60):
        assert parse_cron(text).next(first + later) == utc("2026-10-26T01:30")
    hourly = times("0 * * * * Europe/Zurich", after=utc("2026-10-24T23:30"), count=4)
    assert [each[-5:] for each in hourly] == ["00:00", "01:00", "02:00", "03:00"]


@given(
    after=st.floats(utc("2026-01-01T00:00"), utc("2030-01-01T00:00")),
    text=st.sampled_from(
        ["30 2 * * *", "0 * * * *", "*/7 1-3 * * *", "59 23 L * *", "0 0 1 * 1", "5 4 * 2 MON#1"]
    ),
    zone=st.sampled_from(["UTC", "Europe/Zurich", "America/New_York", "Australia/Lord_Howe"]),
)
def test_the_next_time_lies_ahead_and_none_lies_between(after: float, text: str, zone: str) -> None:
    cron = Cron(text, zone)
    at = cron.next(after)
    assert at is not None
    assert at > after
    assert cron.next(at - 0.5) == at
    assert cron.next(max(after, at - 7.0)) == at


def test_what_never_comes_has_no_time_and_is_found_out_soon() -> None:
    assert parse_cron("* * */20 * 1L").next(utc("2026-11-26T00:00")) is None
    assert parse_cron("0 0 29 2 *").next(utc("2097-03-01T00:00")) == utc("2104-02-29T00:00")
    assert parse_cron("0 6 * * *").next(1e18) is None  # no such year
    assert utc_text(1e18) == "1000000000000000000 s UTC"


def test_what_is_no_repetition_is_refused() -> None:
    for text, why in (
        ("9", "expected 10 s"),
        (str(MAX_PERIOD + 1), "expected 10 s"),
        ("1h", "expected minute"),
        ("61 * * * *", "bad minute"),
        ("0 0 30 2 *", "bad day-of-month"),
        ("* * * * * *", "time zone"),
        ("0 6 * * * Mars/Olympus", "time zone"),
        ("0 6 * * * ../../etc/passwd", "time zone"),
        ("0 6 * * * Europe", "time zone"),
        ("", "expected minute"),
        ("0 6 * * * " + "x" * MAX_REPEAT, "more than"),
        ("٣٠", "expected minute"),
    ):
        with pytest.raises(ValueError, match=why):
            rule_of(text)


@given(st.text(alphabet="0123456789*/,-#LW MON\0aé", max_size=40))
def test_whatever_text_comes_it_is_a_rule_or_a_value_error(text: str) -> None:
    try:
        rule = rule_of(text)
    except ValueError:
        return
    assert rule_of(canonical(text)) == rule
    if isinstance(rule, Cron):
        found = rule.next(OFFSET)
        assert found is None or found > OFFSET


def test_a_task_that_begins_to_repeat_has_a_start_time_and_a_deadline_after_it() -> None:
    now = task(terms=Terms(deadline=400.0), submitted_at=100.0)
    assert repeating(now, "3600", now=101.0, wall_offset=OFFSET) == Terms(
        repeat="3600", series=now.id, start_at=100.0, start_within=300.0
    )
    cron = repeating(now, "0 6 * * *", now=101.0, wall_offset=OFFSET)
    assert cron.start_utc == Cron("0 6 * * *").next(OFFSET + 101.0)
    assert (cron.start_at, cron.start_within, cron.deadline) == (None, 300.0, None)
    with pytest.raises(ValueError, match="never"):
        repeating(now, "* * */20 * 1L", now=101.0, wall_offset=OFFSET)


def test_times_after_a_clock_that_was_set_back_count_from_now() -> None:
    terms = Terms(repeat="0 6 * * *", series=1, start_utc=int(utc("2027-11-27T06:00")))
    moved = brought_forward(terms, utc=utc("2026-11-26T12:00"))
    assert moved.start_utc == utc("2026-11-27T06:00")
    daily = Terms(repeat=str(DAY), series=1, start_utc=int(utc("2027-11-27T06:00")))
    assert brought_forward(daily, utc=utc("2026-11-26T12:00")).start_utc == moved.start_utc
    assert brought_forward(HOURLY, utc=0.0) is HOURLY
    assert brought_forward(moved, utc=utc("2026-11-26T12:00")) is moved
