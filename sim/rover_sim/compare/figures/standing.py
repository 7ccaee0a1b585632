"""What a standing rover reports: disarmed, and armed on streamed zeros."""

import math
import statistics
from collections.abc import Sequence

from rover_sim.compare.figure import (
    ANGLE,
    COUNT,
    FINE_ANGLE,
    FINE_YAW_RATE,
    NOISE,
    PLAIN,
    SHARE,
    WANDER,
    Figure,
    Group,
    quantile,
    turned_either_way,
    unwrapped,
)
from rover_sim.compare.manoeuvres import READYING, STANDING_ARMED, STANDING_DISARMED
from rover_sim.compare.trace import Heard, Span, Trace, TruePose

LOOKED_AT = 20.0  # s, the last part of it
STANDS = 0.03  # m/s


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of both times at rest."""
    return [
        *_standing(trace, STANDING_DISARMED, "Standing disarmed"),
        *_standing(trace, STANDING_ARMED, "Standing armed"),
        *_first_zeros(trace),
    ]


def _standing(trace: Trace, mark: str, title: str) -> list[Figure]:
    span = trace.span(mark)
    if span is None:
        return []
    span = Span(max(span.begin, span.end - LOOKED_AT), span.end)
    group, poses = Group(title), trace.true_poses(span)
    rows = trace.messages("LOCAL_POSITION_NED", span)
    speeds = [math.hypot(each.message.vx, each.message.vy) for each in rows]
    group.add_spread("reported speed", speeds, NOISE)
    below = 100.0 * sum(speed < STANDS for speed in speeds) / len(speeds)
    group.add("reported speed below 0.03 m/s", below, SHARE)
    vn, ve = [each.message.vx for each in rows], [each.message.vy for each in rows]
    offset = math.hypot(statistics.fmean(vn), statistics.fmean(ve))
    group.add("reported velocity, its mean", offset, NOISE)
    for lag in (1.0, 3.0):
        group.add(f"its north part alike after {lag:.0f} s", _alike(rows, lag), PLAIN)
    _add_position(group, rows)
    _add_yaw(group, trace, span)
    _add_truth(group, poses)
    states = trace.messages("EXTENDED_SYS_STATE", span)
    group.add("landed_state", states[-1].message.landed_state if states else None, COUNT)
    return group.figures


def _alike(rows: Sequence[Heard], lag: float) -> float | None:
    """Return the autocorrelation of the north velocity, or None if it is constant."""
    values = [each.message.vx for each in rows]
    mean, variance = statistics.fmean(values), statistics.pvariance(values)
    if variance == 0.0:
        return None
    step = (rows[-1].time - rows[0].time) / (len(rows) - 1)
    shift = round(lag / step)
    pairs = zip(values, values[shift:], strict=False)
    return float(statistics.fmean((a - mean) * (b - mean) for a, b in pairs) / variance)


def _add_position(group: Group, rows: Sequence[Heard]) -> None:
    x, y = [each.message.x for each in rows], [each.message.y for each in rows]
    middle = statistics.fmean(x), statistics.fmean(y)
    away = [math.dist(place, middle) for place in zip(x, y, strict=True)]
    group.add("reported position from its mean, p95", quantile(away, 0.95), WANDER)
    group.add("reported position from its mean, max", max(away), WANDER)


def _add_yaw(group: Group, trace: Trace, span: Span) -> None:
    rows = [each.message for each in trace.messages("ATTITUDE", span)]
    yaw = unwrapped([row.yaw for row in rows])
    group.add("reported yaw, standard deviation", math.degrees(statistics.pstdev(yaw)), FINE_ANGLE)
    rates = [math.degrees(abs(row.yawspeed)) for row in rows]
    group.add_spread("reported yaw rate", rates, FINE_YAW_RATE)


def _add_truth(group: Group, poses: Sequence[TruePose]) -> None:
    group.add("true speed, max", max(abs(pose.speed) for pose in poses), NOISE)
    group.add("truly turned", turned_either_way([pose.yaw for pose in poses]), ANGLE)


def _first_zeros(trace: Trace) -> list[Figure]:
    begin, standing = trace.span(READYING), trace.span(STANDING_ARMED)
    if begin is None or standing is None:
        return []
    group = Group("Standing armed")
    poses = trace.true_poses(Span(begin.begin, standing.end))
    group.add(
        "turned by the first streamed zeros", turned_either_way([pose.yaw for pose in poses]), ANGLE
    )
    return group.figures
