"""Parse and format durations and times of day. Pure."""

import re
from datetime import datetime, time, timedelta, tzinfo

from mav_tasks.basics.errors import UsageError
from mav_tasks.tasks.task import MAX_DELAY

_NUMBER = r"(\d+(?:\.\d+)?)"
DURATION = re.compile(rf"(?:{_NUMBER}d)?(?:{_NUMBER}h)?(?:{_NUMBER}m)?(?:{_NUMBER}s?)?", re.ASCII)
UNITS = (86_400.0, 3600.0, 60.0, 1.0)  # s, of the four groups


def parse_duration(name: str, text: str) -> float:
    """Return the seconds of "90", "30s", "5m", "1h30m" or "2d". Raise UsageError if invalid."""
    match = DURATION.fullmatch(text.strip().lower())
    if not match or not any(match.groups()):
        raise UsageError(f"{name} {text}: expected a duration such as 30s, 5m or 1h30m")
    parts = zip(match.groups(), UNITS, strict=True)
    seconds = sum(float(number) * unit for number, unit in parts if number)
    if seconds > MAX_DELAY:
        raise UsageError(f"{name} {text}: more than a year")
    return seconds


def parse_moment(name: str, text: str, *, now: datetime, zone: tzinfo | None = None) -> datetime:
    """Return the moment of "2026-11-20T14:30", or the next "14:30"; ``now`` has a time zone.

    Without a zone in the text ("…Z", "…+01:00") it is local time of ``zone``; None: the system's.
    Raise UsageError if invalid, past, or more than a year ahead.
    """
    # the standard library would also accept a date, "14" or "1430": none is clearly a time
    moment = (_next(text, now, zone) or _dated(text, zone)) if ":" in text else None
    if moment is None:
        raise UsageError(f"{name} {text}: expected a time such as 14:30 or 2026-11-20T14:30")
    if moment <= now:
        raise UsageError(f"{name} {text}: that time is in the past")
    if (moment - now).total_seconds() > MAX_DELAY:
        raise UsageError(f"{name} {text}: more than a year ahead")
    return moment


def format_duration(seconds: float) -> str:
    """Return a duration in the form that ``parse_duration`` reads: "4.2s", "5m", "1h30m"."""
    if seconds < UNITS[2] - 0.05:
        return f"{seconds:.1f}".removesuffix(".0") + "s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    parts = ((days, "d"), (hours, "h"), (minutes, "m"), (rest, "s"))
    return "".join(f"{value}{unit}" for value, unit in parts if value)


def spoken_duration(seconds: float) -> str:
    """Return a duration for people, rounded to seconds, in at most two units: "1 min 20 s"."""
    minutes, rest = divmod(round(max(seconds, 0.0)), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    parts = [(days, "d"), (hours, "h"), (minutes, "min"), (rest, "s")]
    while len(parts) > 1 and not parts[0][0]:
        del parts[0]
    return " ".join(f"{value} {unit}" for value, unit in parts[:2] if value or len(parts) == 1)


def moment_ago(seconds: float, *, now: datetime) -> str:
    """Return the time of day ``seconds`` before ``now``, with the date if it was another day."""
    moment = now - timedelta(seconds=seconds)
    if moment.date() == now.date():
        return moment.strftime("%H:%M:%S")
    return moment.strftime("%Y-%m-%d %H:%M")


def _next(text: str, now: datetime, zone: tzinfo | None) -> datetime | None:
    try:
        hour = time.fromisoformat(text)
    except ValueError:
        return None
    today = now.astimezone(hour.tzinfo or zone).date()
    moment = _local(datetime.combine(today, hour), zone)
    if moment > now:
        return moment
    return _local(datetime.combine(today + timedelta(days=1), hour), zone)


def _dated(text: str, zone: tzinfo | None) -> datetime | None:
    try:
        return _local(datetime.fromisoformat(text), zone)
    except ValueError:
        return None


def _local(moment: datetime, zone: tzinfo | None) -> datetime:
    if moment.tzinfo is not None:
        return moment
    return moment.replace(tzinfo=zone) if zone is not None else moment.astimezone()
