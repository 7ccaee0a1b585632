"""Ways to end a drive at 1 m/s: HOLD, end of the setpoints, disarming."""

import re

from rover_sim.compare.figure import (
    ANGLE,
    DISTANCE,
    SPEED,
    TIME,
    WORDS,
    Figure,
    Group,
    turned_either_way,
)
from rover_sim.compare.figures.motion import rest_of
from rover_sim.compare.manoeuvres import DISARM, HOLD, SILENCE
from rover_sim.compare.trace import Span, Trace

NUMBERS = re.compile(r"\d+")
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
HEARTBEAT_PERIOD = 1.0  # s: the last HEARTBEAT before the start has the first mode
ARDUPILOT_MODES = {0: "MANUAL", 4: "HOLD", 11: "RTL", 15: "GUIDED", 16: "INITIALISING"}
PX4_MODES = {(4, 3): "HOLD", (4, 5): "RTL", (4, 6): "LAND", (6, 0): "OFFBOARD"}


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of each ending."""
    return [figure for mark in (HOLD, SILENCE, DISARM) for figure in _ending(trace, mark)]


def _ending(trace: Trace, mark: str) -> list[Figure]:
    span = trace.span(mark)
    if span is None:
        return []
    start = _last_setpoint(trace, span) if mark == SILENCE else span.begin
    group = Group(mark)
    poses = trace.true_poses(span)
    first = poses[0].speed
    group.add("speed at the start", first, SPEED)
    slower = next((p.time - start for p in poses if p.speed < 0.9 * first), None)
    group.add("slower by a tenth after", slower, TIME)
    rest = rest_of(poses, start)
    group.add("stands after", rest and rest.after, TIME)
    group.add("stands within", rest and rest.way, DISTANCE)
    group.add("top speed", max(abs(pose.speed) for pose in poses), SPEED)
    group.add("yaw changed", turned_either_way([pose.yaw for pose in poses]), ANGLE)
    changes = _modes(trace, Span(start, span.end))
    group.add("modes", ", ".join(name for name, _ in changes), WORDS)
    last = changes[-1][1] if len(changes) > 1 else None
    group.add("last change of mode seen after", last, TIME)
    texts = (NUMBERS.sub("#", text) for text in trace.texts(span))
    heard = [text for text in texts if not text.startswith(("No ap_message", "[logger]"))]
    group.add("texts", "; ".join(heard) or None, WORDS)
    return group.figures


def _last_setpoint(trace: Trace, span: Span) -> float:
    sent = trace.requests("SET_POSITION_TARGET_LOCAL_NED", Span(0.0, span.begin + 0.2))
    return sent[-1].time


def _modes(trace: Trace, span: Span) -> list[tuple[str, float]]:
    """Return the modes in HEARTBEAT, with the seconds from the start to the first of each."""
    early = Span(span.begin - 1.5 * HEARTBEAT_PERIOD, span.end)
    changes: list[tuple[str, float]] = []
    for each in trace.messages("HEARTBEAT", early):
        custom = int(each.message.custom_mode)
        px4 = custom >> 16 & 0xFF, custom >> 24
        named = PX4_MODES.get(px4) if trace.is_px4 else ARDUPILOT_MODES.get(custom)
        name = named or f"mode {custom}"
        if not int(each.message.base_mode) & ARMED:
            name += " disarmed"
        if not changes or changes[-1][0] != name:
            changes.append((name, max(0.0, each.time - span.begin)))
    return changes
