"""Traces made of arithmetic, for figures whose values are known."""

import math
from collections.abc import Callable
from types import SimpleNamespace

from rover_sim.compare.figure import Figure, Value
from rover_sim.compare.trace import Heard, Mark, Trace, TruePose

PERIOD = 0.025  # s between two poses
ARDUPILOT, PX4 = 3, 12


def trace_of(
    speed: Callable[[float], float],
    marks: dict[str, float],
    *,
    yaw_rate: Callable[[float], float] = lambda _: 0.0,
    autopilot: int = ARDUPILOT,
) -> Trace:
    """Return a trace that drives at that speed, straight or turning, up to the last mark."""
    trace = Trace(marks=[Mark(at, name) for name, at in marks.items()])
    north = east = yaw = 0.0
    for count in range(round(max(marks.values()) / PERIOD) + 1):
        at = count * PERIOD
        v, rate = speed(at), yaw_rate(at)
        trace.poses.append(TruePose(at, north, east, yaw, v, rate))
        north += v * math.cos(yaw) * PERIOD
        east += v * math.sin(yaw) * PERIOD
        yaw += rate * PERIOD
    hear(trace, "HEARTBEAT", 0.0, autopilot=autopilot, base_mode=0, custom_mode=0)
    return trace


def hear(trace: Trace, name: str, at: float, **fields: object) -> None:
    """Let the rover have said that."""
    trace.heard.setdefault(name, []).append(Heard(at, SimpleNamespace(**fields)))


def send(trace: Trace, name: str, at: float, **fields: object) -> None:
    """Let the driver have sent that."""
    trace.sent.setdefault(name, []).append(Heard(at, SimpleNamespace(**fields)))


def value_of(figures: list[Figure], name: str) -> Value:
    """Return the value of the only figure of that name."""
    (value,) = [figure.value for figure in figures if figure.name == name]
    return value
