"""Steps of speed: acceleration, steady speed, stop."""

import math
import statistics
from collections.abc import Sequence
from dataclasses import replace

from rover_sim.compare.driver import Step
from rover_sim.compare.figure import (
    ANGLE,
    DISTANCE,
    NOISE,
    SHARE,
    SPEED,
    TIME,
    Figure,
    Group,
    turned_either_way,
)
from rover_sim.compare.figures.motion import rest_of
from rover_sim.compare.manoeuvres import SPEED_STEPS, THEN_ZEROS
from rover_sim.compare.trace import Trace, TruePose, path_length

STEADY_FROM = 0.6  # of the step's time: the overshoot is over
CREEPING = 0.2  # m/s and below


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of every step of speed in the trace."""
    return [figure for step in SPEED_STEPS for figure in _step(trace, step)]


def _step(trace: Trace, step: Step) -> list[Figure]:
    span = trace.span(step.name)
    if span is None:
        return []
    group = Group(f"Step {step.name}")
    raw = trace.true_poses(span)
    poses = _along_course(raw) if trace.is_px4 else raw
    steady = [pose.speed for pose in poses[int(len(poses) * STEADY_FROM) :]]
    group.add("steady speed", statistics.median(steady), SPEED)
    group.add("scatter of the steady speed", statistics.pstdev(steady), NOISE)
    for share in (0.1, 0.63, 0.9):
        name = f"reaches {share * 100:.0f} % of what was asked"
        group.add(name, _rise(poses, span.begin, step.speed * share), TIME)
    group.add("peak over what was asked", _overshoot(poses, step.speed), SHARE)
    if abs(step.speed) > CREEPING:
        group.add("yaw changed", turned_either_way([pose.yaw for pose in raw]), ANGLE)
    else:
        seconds = poses[-1].time - poses[0].time
        group.add("mean speed over 8 s", path_length(poses) / seconds, SPEED)
    _add_stop(group, trace, step)
    return group.figures


def _along_course(poses: Sequence[TruePose]) -> list[TruePose]:
    """Return the poses with the speed along the first heading: PX4 follows a velocity vector."""
    first = poses[0].yaw
    return [replace(pose, speed=pose.speed * math.cos(pose.yaw - first)) for pose in poses]


def _rise(poses: Sequence[TruePose], begin: float, speed: float) -> float | None:
    sign = math.copysign(1.0, speed)
    reached = (pose.time for pose in poses if pose.speed * sign >= abs(speed))
    return next((at - begin for at in reached), None)


def _overshoot(poses: Sequence[TruePose], asked: float) -> float:
    sign = math.copysign(1.0, asked)
    return 100.0 * (max(pose.speed * sign for pose in poses) / abs(asked) - 1.0)


def _add_stop(group: Group, trace: Trace, step: Step) -> None:
    span = trace.span(step.name + THEN_ZEROS)
    if span is None:
        return
    poses = trace.true_poses(span)
    rest = rest_of(poses, span.begin)
    group.add("stops after", rest and rest.after, TIME)
    group.add("stops within", rest and rest.way, DISTANCE)
    if abs(step.speed) > CREEPING:
        sign = math.copysign(1.0, poses[0].speed)
        back = max(-pose.speed * sign for pose in poses)
        group.add("swings back to", max(0.0, back), SPEED)
        group.add("yaw changed by zeros", turned_either_way([pose.yaw for pose in poses]), ANGLE)
