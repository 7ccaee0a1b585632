"""Origin and home: how often they change, and when home moves."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

from rover_sim.compare.figure import COUNT, DISTANCE, WORDS, Figure, Group, quantile
from rover_sim.compare.manoeuvres import DISARM, DISARMED_AGAIN, DRIVEN, READYING
from rover_sim.compare.trace import Heard, Span, Trace

EARTH_RADIUS = 6378137.0  # m, WGS 84
ARMS_WITHIN = 2.4  # s, the duration of arming and taking control
MOVED = 0.3  # m; less is the estimate's noise

Place = tuple[float, float]  # latitude and longitude, 1e-7 degrees


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of GPS_GLOBAL_ORIGIN and HOME_POSITION."""
    group = Group("Origin and home")
    for name in ("GPS_GLOBAL_ORIGIN", "HOME_POSITION"):
        rows = trace.messages(name)
        if not rows:
            group.add(f"{name}, different values", None, COUNT)
            continue
        places = [_place(each.message) for each in rows]
        away = max(_distance(places[0], place) for place in set(places))
        heights = [each.message.altitude / 1000.0 for each in rows]
        group.add(f"{name}, different places", len(set(places)), COUNT)
        group.add(f"{name}, farthest from the first", away, DISTANCE)
        group.add(f"{name}, spread of altitude", max(heights) - min(heights), DISTANCE)
        leaps = _leaps(places, heights)
        group.add(f"{name}, leap of altitude in one place, p95", quantile(leaps, 0.95), DISTANCE)
    _add_moves(group, trace)
    return group.figures


def _place(message: Any) -> Place:
    return message.latitude, message.longitude


def _distance(a: Place, b: Place) -> float:
    north = math.radians((b[0] - a[0]) * 1e-7) * EARTH_RADIUS
    east = math.radians((b[1] - a[1]) * 1e-7) * EARTH_RADIUS * math.cos(math.radians(a[0] * 1e-7))
    return math.hypot(north, east)


def _leaps(places: Sequence[Place], heights: Sequence[float]) -> list[float]:
    rows = list(zip(places, heights, strict=True))
    return [abs(b[1] - a[1]) for a, b in itertools.pairwise(rows) if a[0] == b[0]]


def _add_moves(group: Group, trace: Trace) -> None:
    """Add the situations in which home follows the rover."""
    rows = trace.messages("HOME_POSITION")
    rolling = _moves_within(rows, trace, DISARM)
    group.add("home's moves when disarmed at 1 m/s", rolling, COUNT)
    group.add("home moves when disarmed", _yes(_moves_within(rows, trace, DISARMED_AGAIN)), WORDS)
    group.add("home moves while driving", _yes(_moves_within(rows, trace, DRIVEN)), WORDS)
    again = [mark.time for mark in trace.marks if mark.name == READYING][1:]
    armed = sum(_moves(rows, Span(at, at + ARMS_WITHIN)) for at in again)
    group.add("home moves when armed", _yes(armed), WORDS)


def _yes(moves: int) -> str:
    return "yes" if moves else "no"


def _moves_within(rows: Sequence[Heard], trace: Trace, mark: str) -> int:
    span = trace.span(mark)
    return _moves(rows, span) if span else 0


def _moves(rows: Sequence[Heard], span: Span) -> int:
    """Return how often home moved, including a move from the last value before the span."""
    before = [each for each in rows if each.time < span.begin][-1:]
    within = [each for each in rows if span.begin <= each.time <= span.end]
    places = [_place(each.message) for each in (*before, *within)]
    return sum(_distance(a, b) > MOVED for a, b in itertools.pairwise(places))
