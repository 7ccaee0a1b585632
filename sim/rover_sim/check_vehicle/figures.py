"""What is measured in a trace: figures by group and name, of which real.csv says unit and limit."""

import math
import re
import statistics
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

from pymavlink.dialects.v20 import development as mav

from rover_sim.check_vehicle.manoeuvres import ARMED, ASKED, READYING, Span, Trace
from rover_sim.observing.driver import ARMED as ARMED_FLAG
from rover_sim.observing.track import Place, way

Value = float | str | None  # None: it did not happen, or was never sent
Named = Iterator[tuple[str, Value]]

STANDS = 0.03  # m/s, true speed
STANDS_FOR = 0.4  # s of standing, or up to the end of the poses
STEADY_FROM = 0.6  # of a step's time: the overshoot is over
RISEN = 0.63  # of the speed that was asked
LOOKED_AT = 20.0  # s, the last part of standing
EVERY = 3  # of the reported samples, which come faster than anything changes
ARMS_WITHIN = 2.4  # s, the duration of arming and taking control
HOME_MOVED = 2.7e-6  # deg, 0.3 m; less is the estimate's noise
HEARTBEAT_PERIOD = 1.0  # s: the last HEARTBEAT before the start has the first mode
PREARM = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK
REASONS = ("Arm:", "PreArm", "Arming denied", "Preflight Fail")
RESULTS = ("accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress")
NUMBERS = re.compile(r"\d+")
MODES = {
    0: "MANUAL",
    4: "HOLD",
    11: "RTL",
    15: "GUIDED",
    16: "INITIALISING",
    **{main << 16 | sub << 24: name for main, sub, name in ((4, 3, "HOLD"), (4, 5, "RTL"))},
    4 << 16 | 6 << 24: "LAND",
    6 << 16: "OFFBOARD",
}
GUIDED = 15


def figures_of(trace: Trace) -> dict[tuple[str, str], Value]:
    """Return every figure by group and name: of the manoeuvres by their marks."""
    groups: dict[str, Named] = {
        "Start": _start(trace),
        "Standing disarmed": _standing(trace, "standing disarmed"),
        "Standing armed": _standing(trace, "standing armed"),
        "Origin and home": _home(trace),
        **{mark: _motion(trace, mark) for _, mark in trace.marks[:-1]},
    }
    return {(group, name): value for group, named in groups.items() for name, value in named}


# helpers


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return the value below which ``share`` of the values lie; None if there are none."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else None


def _spread(name: str, values: Sequence[float]) -> Named:
    yield f"{name}, p50", quantile(values, 0.5)
    yield f"{name}, p95", quantile(values, 0.95)


def _unwrapped(angles: Sequence[float]) -> list[float]:
    out: list[float] = []
    for angle in angles:
        out.append(out[-1] + math.remainder(angle - out[-1], math.tau) if out else angle)
    return out


def _turned(places: Sequence[Place]) -> float:
    """Return the degrees from the first heading to the last, through all between."""
    smooth = _unwrapped([place.yaw for place in places])
    return math.degrees(smooth[-1] - smooth[0])


def _first(trace: Trace, name: str, fits: Callable[[Any], object] = lambda _: True) -> Value:
    """Return the seconds from the first of all messages to the first that fits, or None."""
    began = min(rows[0].at for rows in trace.heard.values())
    found = (each.at - began for each in trace.heard.get(name, ()) if fits(each.message))
    return next(found, None)


def _texts(trace: Trace, span: Span) -> list[str]:
    return [str(each.message.text).strip() for each in trace.messages("STATUSTEXT", span)]


def _rest(poses: Sequence[Place], start: float) -> tuple[Value, Value]:
    """Return when and after which way the rover stood for STANDS_FOR; None if it did not."""
    since = None  # index of the first pose of the present standing
    for i, pose in enumerate(poses):
        if abs(pose.speed) >= STANDS:
            since = None
        elif since is None:
            since = i
        if since is not None and pose.time - poses[since].time >= STANDS_FOR:
            break
    if since is None:
        return None, None
    return poses[since].time - start, way(list(poses[: since + 1]))


# the groups


def _start(trace: Trace) -> Named:
    armed_at = next(at for at, name in trace.marks if name == ARMED)
    until_armed = Span(0.0, armed_at)
    began = min(rows[0].at for rows in trace.heard.values())
    yield "first LOCAL_POSITION_NED", _first(trace, "LOCAL_POSITION_NED")
    yield "first GPS_GLOBAL_ORIGIN", _first(trace, "GPS_GLOBAL_ORIGIN")
    yield "first HOME_POSITION", _first(trace, "HOME_POSITION")
    healthy = _first(trace, "SYS_STATUS", lambda m: m.onboard_control_sensors_health & PREARM)
    yield "pre-arm check healthy", healthy
    arming = [each for each in trace.answers if each.command == mav.MAV_CMD_COMPONENT_ARM_DISARM]
    accepted = next(each for each in arming if each.is_accepted)
    yield "arming accepted", accepted.asked_at + accepted.took - began
    if not trace.make.is_px4:
        asked = [each for each in trace.answers if each.command == mav.MAV_CMD_DO_SET_MODE]
        guided = [each for each in asked if each.params[1] == GUIDED and each.is_accepted]
        yield "GUIDED accepted", guided[0].asked_at - began
        within = trace.messages("HEARTBEAT", Span(began + 1.0, began + 6.0))
        lost = any(each.message.custom_mode == 0 for each in within)
        yield "GUIDED lost again", "yes" if lost else "no"
    refused = [RESULTS[each.result] for each in arming[: arming.index(accepted)] if each.result]
    yield "arming refused, times", len(refused)
    yield "arming refused with", ", ".join(dict.fromkeys(refused)) or None
    reasons = [text for text in _texts(trace, until_armed) if text.startswith(REASONS)]
    yield "reasons given", "; ".join(dict.fromkeys(reasons)) or None


def _standing(trace: Trace, mark: str) -> Named:
    whole = trace.span(mark)
    span = Span(max(whole.begin, whole.end - LOOKED_AT), whole.end)
    rows = [each.message for each in trace.messages("LOCAL_POSITION_NED", span)]
    yield from _spread("reported speed", [math.hypot(row.vx, row.vy) for row in rows])
    mean = [statistics.fmean(getattr(row, name) for row in rows) for name in ("vx", "vy", "x", "y")]
    yield "reported velocity, its mean", math.hypot(*mean[:2])
    away = [math.dist((row.x, row.y), mean[2:]) for row in rows]
    yield "reported position from its mean, p95", quantile(away, 0.95)
    yaws = _unwrapped([each.message.yaw for each in trace.messages("ATTITUDE", span)])
    yield "reported yaw, standard deviation", math.degrees(statistics.pstdev(yaws))
    poses = trace.poses(span)
    yield "true speed, max", max(abs(pose.speed) for pose in poses)
    yield "truly turned", abs(_turned(poses))
    states = trace.messages("EXTENDED_SYS_STATE", span)
    yield "landed_state", states[-1].message.landed_state if states else None
    if mark == "standing armed":
        zeros = trace.poses(Span(trace.span(READYING).begin, span.end))
        yield "turned by the first streamed zeros", abs(_turned(zeros))


def _motion(trace: Trace, mark: str) -> Named:
    """Measure one manoeuvre; which of these figures count, real.csv says."""
    span = trace.span(mark)
    poses = trace.poses(span)
    if len(poses) < 2:
        return
    is_silent = mark.startswith("set-points end")
    start = trace.set_points_ended if is_silent else span.begin
    first, late = poses[0], poses[int(len(poses) * STEADY_FROM) :]
    # PX4 follows a velocity over ground: its speed along the first heading
    along = [p.speed * (math.cos(p.yaw - first.yaw) if trace.make.is_px4 else 1.0) for p in poses]
    yield "speed at the start", first.speed
    yield "steady speed", statistics.median(along[-len(late) :])
    ended = [pose.speed for pose in poses if pose.time > span.end - 1.0]
    yield "speed at the end", statistics.median(ended)
    yield "top speed", max(abs(pose.speed) for pose in poses)
    yield "rate reached", math.degrees(statistics.median(pose.yaw_rate for pose in late))
    yield "turned", _turned(poses)
    yield "turned either way", abs(_turned(poses))
    yield "way", way(poses)
    stood, within = _rest(poses, start)
    yield "stands after", stood
    yield "stands within", within
    slower = (pose.time - start for pose in poses if pose.speed < 0.9 * first.speed)
    yield "slower by a tenth after", next(slower, None)
    if asked := ASKED.get(mark):
        rises = zip(poses, along, strict=True)
        risen = (pose.time - start for pose, speed in rises if speed / asked >= RISEN)
        yield "reaches 63 % of what was asked", next(risen, None)
    names = []
    for each in trace.messages("HEARTBEAT", Span(start - 1.5 * HEARTBEAT_PERIOD, span.end)):
        mode = MODES.get(each.message.custom_mode, f"mode {each.message.custom_mode}")
        names.append(mode if each.message.base_mode & ARMED_FLAG else f"{mode} disarmed")
    yield "modes", ", ".join(dict.fromkeys(names))
    yield "texts", "; ".join(NUMBERS.sub("#", text) for text in _texts(trace, span)) or None


def _home(trace: Trace) -> Named:
    """When home follows the rover, and whether the origin stays."""
    origins = {
        (each.message.latitude, each.message.longitude)
        for each in trace.heard.get("GPS_GLOBAL_ORIGIN", ())
    }
    yield "GPS_GLOBAL_ORIGIN, different places", len(origins)
    rows = trace.heard["HOME_POSITION"]
    moves = [after.at for before, after in pairwise(rows) if _moved(before.message, after.message)]

    def within(*spans: Span) -> str:
        is_moved = any(span.begin <= at <= span.end for at in moves for span in spans)
        return "yes" if is_moved else "no"

    yield "home moves when disarmed", within(trace.span("home: disarmed again"))
    yield "home moves while driving", within(trace.span("home: driven"))
    armed = [at for at, name in trace.marks if name == READYING][1:]
    yield "home moves when armed", within(*(Span(at, at + ARMS_WITHIN) for at in armed))


def _moved(one: Any, other: Any) -> bool:
    north = (other.latitude - one.latitude) * 1e-7
    east = (other.longitude - one.longitude) * 1e-7 * math.cos(math.radians(one.latitude * 1e-7))
    return math.hypot(north, east) > HOME_MOVED
