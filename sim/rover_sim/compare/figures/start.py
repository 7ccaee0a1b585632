"""Figures from the first message to the first arming."""

import itertools
import math
from collections.abc import Callable
from typing import Any

from rover_sim.compare.figure import ANGLE, COUNT, DISTANCE, START_TIME, WORDS, Figure, Group
from rover_sim.compare.manoeuvres import ARMED, STANDING_ARMED
from rover_sim.compare.trace import Heard, Span, Trace

FIX_3D = 3
PREARM = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK
SET_MODE, ARM = 176, 400  # MAV_CMD
GUIDED = 15
REASONS = ("Arm:", "PreArm", "Arming denied", "Preflight Fail")
#: MAV_RESULT
RESULTS = ("accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress")


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of the start."""
    group = Group("Start")
    add = group.add
    add("first LOCAL_POSITION_NED", _first(trace, "LOCAL_POSITION_NED"), START_TIME)
    add("GPS fix", _first(trace, "GPS_RAW_INT", lambda m: m.fix_type >= FIX_3D), START_TIME)
    add("first GPS_GLOBAL_ORIGIN", _first(trace, "GPS_GLOBAL_ORIGIN"), START_TIME)
    add("first HOME_POSITION", _first(trace, "HOME_POSITION"), START_TIME)
    healthy = _first(trace, "SYS_STATUS", lambda m: m.onboard_control_sensors_health & PREARM)
    add("pre-arm check healthy", healthy, START_TIME)
    armed = _first(trace, "COMMAND_ACK", lambda m: m.command == ARM and m.result == 0)
    add("arming accepted", armed, START_TIME)
    if not trace.is_px4:
        add("GUIDED accepted", _guided(trace), START_TIME)
        add("GUIDED lost again", _guided_lost(trace), WORDS)
        using = _first(trace, "STATUSTEXT", lambda m: "using GPS" in str(m.text))
        add("text that the estimator uses GPS", using, START_TIME)
    refusals = _refusals(trace)
    add("arming refused, times", len(refusals), COUNT)
    add("arming refused with", ", ".join(dict.fromkeys(refusals)) or None, WORDS)
    add("reasons given", _reasons(trace), WORDS)
    add("first HOME_POSITION has numbers for x, y, z", _home_has_numbers(trace), WORDS)
    add("yaw of the first ATTITUDE off the true one", _first_yaw_off(trace), ANGLE)
    add("largest leap of the reported position before driving", _leap(trace), DISTANCE)
    return group.figures


def _first(trace: Trace, name: str, wanted: Callable[[Any], object] | None = None) -> float | None:
    """Return the seconds from the first of all messages to the first matching one, or None."""
    for each in trace.messages(name):
        if wanted is None or wanted(each.message):
            return each.time - trace.first_heard
    return None


def _before_armed(trace: Trace) -> Span:
    armed = next(mark.time for mark in trace.marks if mark.name == ARMED)
    return Span(trace.whole.begin, armed)


def answer_to(trace: Trace, request: Heard) -> Heard | None:
    """Return the COMMAND_ACK of a command within 2 s, or None."""
    within = Span(request.time, request.time + 2.0)
    answers = trace.messages("COMMAND_ACK", within)
    return next((a for a in answers if a.message.command == request.message.command), None)


def _refusals(trace: Trace) -> list[str]:
    out = []
    for request in trace.requests("COMMAND_LONG", _before_armed(trace)):
        answer = answer_to(trace, request) if request.message.command == ARM else None
        if answer is not None and answer.message.result:
            out.append(RESULTS[int(answer.message.result)])
    return out


def _reasons(trace: Trace) -> str | None:
    texts = trace.texts(_before_armed(trace))
    return "; ".join(dict.fromkeys(t for t in texts if t.startswith(REASONS))) or None


def _guided_requests(trace: Trace) -> list[Heard]:
    requests = trace.requests("COMMAND_LONG")
    return [
        r for r in requests if r.message.command == SET_MODE and int(r.message.param2) == GUIDED
    ]


def _guided(trace: Trace) -> float | None:
    for request in _guided_requests(trace):
        answer = answer_to(trace, request)
        if answer is not None and answer.message.result == 0:
            return request.time - trace.first_heard
    return None


def _guided_lost(trace: Trace) -> str | None:
    """Return "yes" if the rover was in MANUAL 1 to 6 s after its first message, else "no"."""
    within = Span(trace.first_heard + 1.0, trace.first_heard + 6.0)
    modes = {int(each.message.custom_mode) for each in trace.messages("HEARTBEAT", within)}
    return "yes" if 0 in modes else "no"


def _leap(trace: Trace) -> float | None:
    standing = trace.span(STANDING_ARMED)
    end = standing.begin if standing else trace.whole.end
    rows = [each.message for each in trace.messages("LOCAL_POSITION_NED", Span(0.0, end))]
    pairs = itertools.pairwise(rows)
    return max((math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairs), default=None)


def _home_has_numbers(trace: Trace) -> str | None:
    rows = trace.messages("HOME_POSITION")
    if not rows:
        return None
    first = rows[0].message
    return "yes" if all(math.isfinite(each) for each in (first.x, first.y, first.z)) else "no"


def _first_yaw_off(trace: Trace) -> float:
    yaw, truth = trace.messages("ATTITUDE")[0].message.yaw, trace.poses[0].yaw
    return abs(math.degrees(math.remainder(yaw - truth, math.tau)))
