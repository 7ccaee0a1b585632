"""Reported motion against true motion, over all manoeuvres."""

import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Sequence

from rover_sim.compare.figure import (
    ANGLE,
    DISTANCE,
    LATENCY,
    NOISE,
    Figure,
    Group,
    quantile,
    unwrapped,
)
from rover_sim.compare.manoeuvres import STANDING_ARMED, THEN_ZEROS
from rover_sim.compare.trace import Span, Trace, TruePose

EVERY = 3  # of the reported samples, which come faster than anything changes
TRULY_STANDS = 0.005  # m/s
SET_MODE, ARM = 176, 400  # MAV_CMD

Truth = Callable[[float], float | None]


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of the estimate and of the telemetry's timing."""
    standing = trace.span(STANDING_ARMED)
    if standing is None:
        return []
    span = Span(standing.begin, trace.whole.end)
    poses = trace.true_poses(span)
    group = Group("Estimate and truth")
    group.add_spread("reported speed while it stands, driven before", _at_rest(trace), NOISE)
    _add_velocity(group, trace, span, poses)
    _add_yaw(group, trace, span, poses)
    _add_position(group, trace, span, poses)
    timing = Group("Timing")
    came = [each.time for each in trace.messages("LOCAL_POSITION_NED", span)]
    gaps = [b - a for a, b in itertools.pairwise(came)]
    timing.add_spread("between two LOCAL_POSITION_NED", gaps, LATENCY)
    waits = _waits(trace)
    timing.add("acknowledgement of mode and arming, p50", quantile(waits, 0.5), LATENCY)
    timing.add("acknowledgement of mode and arming, max", max(waits, default=None), LATENCY)
    return group.figures + timing.figures


def _at_rest(trace: Trace) -> list[float]:
    speeds = []
    for mark in trace.marks:
        if not mark.name.endswith(THEN_ZEROS):
            continue
        span = trace.span(mark.name)
        assert span is not None
        truth = _course(trace.true_poses(span), lambda pose: abs(pose.speed))
        for each in trace.messages("LOCAL_POSITION_NED", span):
            speed = truth(each.time)
            if speed is not None and speed < TRULY_STANDS:
                speeds.append(math.hypot(each.message.vx, each.message.vy))
    return speeds


def _course(poses: Sequence[TruePose], value: Callable[[TruePose], float]) -> Truth:
    """Return the value as a function of time, linear between two poses."""
    times, values = [pose.time for pose in poses], [value(pose) for pose in poses]

    def at(time: float) -> float | None:
        i = bisect_left(times, time)
        if not 0 < i < len(times):
            return None
        share = (time - times[i - 1]) / max(times[i] - times[i - 1], 1e-6)
        return values[i - 1] + share * (values[i] - values[i - 1])

    return at


def _add_velocity(group: Group, trace: Trace, span: Span, poses: Sequence[TruePose]) -> None:
    vn = _course(poses, lambda pose: pose.speed * math.cos(pose.yaw))
    ve = _course(poses, lambda pose: pose.speed * math.sin(pose.yaw))
    errors = []
    for each in trace.messages("LOCAL_POSITION_NED", span)[::EVERY]:
        north, east = vn(each.time), ve(each.time)
        if north is not None and east is not None:
            errors.append(math.hypot(each.message.vx - north, each.message.vy - east))
    group.add_spread("reported velocity off the true one", errors, NOISE)


def _add_yaw(group: Group, trace: Trace, span: Span, poses: Sequence[TruePose]) -> None:
    smooth = unwrapped([pose.yaw for pose in poses])
    by_time = dict(zip((pose.time for pose in poses), smooth, strict=True))
    truth = _course(poses, lambda pose: by_time[pose.time])
    errors = []
    for each in trace.messages("ATTITUDE", span)[::EVERY]:
        yaw = truth(each.time)
        if yaw is not None:
            errors.append(math.degrees(math.remainder(each.message.yaw - yaw, math.tau)))
    group.add_spread("reported yaw off the true one", [abs(each) for each in errors], ANGLE)
    low, high = quantile(errors, 0.05), quantile(errors, 0.95)
    assert low is not None
    assert high is not None
    group.add("reported yaw off the true one, from p5 to p95", high - low, ANGLE)


def _add_position(group: Group, trace: Trace, span: Span, poses: Sequence[TruePose]) -> None:
    """Add the position's drift since the start of the drive."""
    north, east = _course(poses, lambda pose: pose.north), _course(poses, lambda pose: pose.east)
    off = []
    for each in trace.messages("LOCAL_POSITION_NED", span)[::EVERY]:
        x, y = north(each.time), east(each.time)
        if x is not None and y is not None:
            off.append((each.message.x - x, each.message.y - y))
    away = [math.dist(place, off[0]) for place in off]
    group.add_spread("reported position off, against the start", away, DISTANCE)


def _waits(trace: Trace) -> list[float]:
    """Return the seconds between each mode or arming command and its acknowledgement."""
    waits = []
    for request in trace.requests("COMMAND_LONG"):
        if request.message.command in (SET_MODE, ARM):
            within = Span(request.time, request.time + 2.0)
            answers = trace.messages("COMMAND_ACK", within)
            mine = (a.time for a in answers if a.message.command == request.message.command)
            waits += [at - request.time for at in list(mine)[:1]]
    return waits
