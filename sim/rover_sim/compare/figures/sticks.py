"""The throttle stick during offboard control."""

import statistics

from rover_sim.compare.figure import COUNT, SPEED, Figure, Group
from rover_sim.compare.manoeuvres import FREE, PUSHED, RELEASED, STICK_SPEEDS
from rover_sim.compare.trace import Span, Trace

LOOKED_AT = 1.0  # s, the end of each phase


def figures(trace: Trace) -> list[Figure]:
    """Return speed and reported channel with the stick free, pushed and released."""
    out: list[Figure] = []
    for name, _ in STICK_SPEEDS:
        group = Group(f"Throttle stick, asked {name}")
        for phase in (FREE, PUSHED, RELEASED):
            span = trace.span(phase + name)
            if span is None:
                continue
            late = Span(span.end - LOOKED_AT, span.end)
            speed = statistics.median(pose.speed for pose in trace.true_poses(late))
            label = phase.removesuffix(", ")
            group.add(f"speed, {label}", speed, SPEED)
            rows = trace.messages("RC_CHANNELS", Span(span.begin + 1.0, span.end))
            channel = rows[-1].message.chan3_raw if rows else None
            group.add(f"channel 3, {label}", channel, COUNT)
        out += group.figures
    return out
