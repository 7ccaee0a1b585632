"""Cron expressions with a time zone: "0 6 * * 1-5 Europe/Zurich"; UTC if none is named. Pure.

The five fields are those of Debian's cron, also where daylight saving time begins or ends: a run in
the hour that is left out comes just after it, one in the hour that comes twice runs once. This is
the one pure module that computes with datetimes; it is given each moment and asks for none.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from cronsim import CronSim, CronSimError

FIELDS = 5
HORIZON = 8  # years: 29 February comes at least once, also around 2100
UTC_NAMES = frozenset({"UTC", "Etc/UTC"})  # which need no time zone data


@dataclass(frozen=True, slots=True)
class Cron:
    """The five fields of an expression, and the name of a time zone."""

    fields: str
    zone: str = "UTC"

    def __str__(self) -> str:
        return self.fields if self.zone in UTC_NAMES else f"{self.fields} {self.zone}"

    def next(self, after: float) -> int | None:
        """Return the first time after a moment, both in UTC seconds.

        None: no time within HORIZON fits.
        """
        try:
            moment = datetime.fromtimestamp(int(after // 1), _zone(self.zone))
            times = CronSim(self.fields, moment)
            if not _has_day(times, moment):
                return None
            found = int(next(times).timestamp())
            while found <= after:  # the hour that comes twice: cron means the first of them
                found = int(next(times).timestamp())
        except (OverflowError, OSError, StopIteration, ValueError):  # no such year
            return None
        return found


def parse_cron(text: str) -> Cron:
    """Return the expression in a text. Raise ValueError if it is not one."""
    parts = text.split()
    fields, zone = parts[:FIELDS], " ".join(parts[FIELDS:]) or "UTC"
    if len(fields) != FIELDS:
        raise ValueError(
            f"{text!r}: expected minute, hour, day of month, month, day of week,"
            " and perhaps a time zone, such as '0 6 * * 1-5 Europe/Zurich'"
        )
    cron = Cron(" ".join(fields), zone)
    try:
        CronSim(cron.fields, datetime(2000, 1, 1, tzinfo=_zone(zone)))
    except CronSimError as error:
        raise ValueError(f"{text!r}: {str(error).lower()}") from None
    except ZoneInfoNotFoundError:
        raise ValueError(f"{text!r}: the time zone {zone!r} is not known here") from None
    except (AssertionError, TypeError, ValueError):  # parts that do not go together
        raise ValueError(f"{text!r}: not a cron expression") from None
    return cron


def utc_text(utc: float) -> str:
    """Return a time in UTC seconds for people: "2026-11-27 06:00 UTC"."""
    try:
        moment = datetime.fromtimestamp(utc, UTC)
    except (OverflowError, OSError, ValueError):
        return f"{utc:.0f} s UTC"
    seconds = ":%S" if moment.second else ""
    return moment.strftime(f"%Y-%m-%d %H:%M{seconds} UTC")


def _zone(name: str) -> tzinfo:
    """Return a time zone. Raise ZoneInfoNotFoundError or ValueError if it is not known.

    Its rules are read from the system once, and are constants from then on.
    """
    if name in UTC_NAMES:
        return UTC
    try:
        return ZoneInfo(name)
    except (OSError, ValueError) as error:  # a folder's name, or one that leads out of it
        raise ZoneInfoNotFoundError(str(error)) from None


def _has_day(times: CronSim, moment: datetime) -> bool:
    """Return whether a day within HORIZON fits: the library itself would search 50 years."""
    day = moment.date()
    end = day.replace(year=day.year + HORIZON, day=1)
    while day < end:
        if day.month not in times.months:
            day = (day.replace(day=1) + timedelta(days=32)).replace(day=1)
        elif times.match_day(day):
            return True
        else:
            day += timedelta(days=1)
    return False
