"""Durations and times of day on the command line."""

from datetime import UTC, datetime, timedelta, timezone
from zoneinfo import ZoneInfo

import pytest

from mav_tasks.cli.times import format_duration, parse_duration, parse_moment, spoken_duration
from mav_tasks.errors import UsageError

EAST = timezone(timedelta(hours=2))
NOW = datetime(2026, 11, 20, 14, 0, tzinfo=EAST)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("30s", 30.0),
        ("30", 30.0),
        ("0", 0.0),
        ("0.5s", 0.5),
        ("5m", 300.0),
        ("1.5h", 5400.0),
        ("1h30m", 5400.0),
        ("1h5", 3605.0),
        ("2d1h1m1s", 176_461.0),
        (" 5M ", 300.0),
        ("366d", 366 * 86_400.0),
    ],
)
def test_a_duration_is_seconds(text: str, seconds: float) -> None:
    assert parse_duration("--in", text) == seconds


@pytest.mark.parametrize(
    "text",
    [
        "",
        "s",
        "-5s",
        "+5",
        "5 m",
        "30m1h",
        "1h1h",
        "1e3",
        "inf",
        "nan",
        ".5",
        "5.",
        "5w",
        "٥s",
        "14:30",
    ],
)
def test_what_is_no_duration_is_named(text: str) -> None:
    with pytest.raises(UsageError, match=r"--in .*30s, 5m or 1h30m"):
        parse_duration("--in", text)


def test_more_than_a_year_is_a_mistake() -> None:
    for text in ("367d", "9" * 400 + "d", "99999999999h"):
        with pytest.raises(UsageError, match="more than a year"):
            parse_duration("--deadline", text)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0s"),
        (4.24, "4.2s"),
        (59.94, "59.9s"),
        (59.96, "1m"),
        (75.4, "1m15s"),
        (3600.0, "1h"),
        (90_061.0, "1d1h1m1s"),
    ],
)
def test_seconds_are_written_as_they_are_read(seconds: float, text: str) -> None:
    assert format_duration(seconds) == text
    assert parse_duration("it", text) == pytest.approx(seconds, abs=0.5)


@pytest.mark.parametrize(
    ("text", "moment"),
    [
        ("2026-11-20T14:30", datetime(2026, 11, 20, 14, 30, tzinfo=EAST)),
        ("2026-11-21 09:00:05", datetime(2026, 11, 21, 9, 0, 5, tzinfo=EAST)),
        ("2026-11-20T14:30Z", datetime(2026, 11, 20, 14, 30, tzinfo=UTC)),
        ("2026-11-20T14:30+01:00", datetime(2026, 11, 20, 13, 30, tzinfo=UTC)),
        ("14:30", datetime(2026, 11, 20, 14, 30, tzinfo=EAST)),
        ("13:59", datetime(2026, 11, 21, 13, 59, tzinfo=EAST)),
        ("14:00", datetime(2026, 11, 21, 14, 0, tzinfo=EAST)),  # now is over
        ("12:30Z", datetime(2026, 11, 20, 12, 30, tzinfo=UTC)),
        ("11:30Z", datetime(2026, 11, 21, 11, 30, tzinfo=UTC)),
    ],
)
def test_a_time_is_a_moment_here_unless_it_names_a_zone(text: str, moment: datetime) -> None:
    assert parse_moment("--at", text, now=NOW, zone=EAST) == moment


def test_local_time_is_the_systems_own() -> None:
    now = datetime.now(UTC)
    wished = (now.astimezone() + timedelta(minutes=5)).replace(tzinfo=None, microsecond=0)
    moment = parse_moment("--at", wished.isoformat(), now=now)
    assert timedelta(minutes=4, seconds=58) < moment - now <= timedelta(minutes=5)


def test_the_next_half_past_two_is_that_of_the_clock_on_the_wall() -> None:
    """The night in which summer time ends has an hour more."""
    berlin = ZoneInfo("Europe/Berlin")
    now = datetime(2026, 10, 24, 12, 0, tzinfo=berlin)
    moment = parse_moment("--at", "08:00", now=now, zone=berlin)
    assert moment == datetime(2026, 10, 25, 8, 0, tzinfo=berlin)
    assert (moment.astimezone(UTC) - now.astimezone(UTC)) == timedelta(hours=21)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("noon", "14:30"),
        ("14", "14:30"),
        ("1430", "14:30"),
        ("2026-11-20", "14:30"),
        ("25:00", "14:30"),
        ("2026-02-30T10:00", "14:30"),
        ("2026-11-20T13:00", "in the past"),
        ("2028-11-20T13:00", "more than a year"),
    ],
)
def test_what_is_no_time_to_come_is_named(text: str, why: str) -> None:
    with pytest.raises(UsageError, match=f"--at {text}.*{why}"):
        parse_moment("--at", text, now=NOW, zone=EAST)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (-3.0, "0 s"),
        (0.4, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min"),
        (80.0, "1 min 20 s"),
        (3600.0, "1 h"),
        (7530.0, "2 h 5 min"),
        (86_400.0 + 59, "1 d"),
        (3 * 86_400.0 + 4 * 3600 + 59, "3 d 4 h"),
    ],
)
def test_a_duration_is_read_in_two_units_at_most(seconds: float, words: str) -> None:
    assert spoken_duration(seconds) == words
