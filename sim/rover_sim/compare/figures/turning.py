"""Turns: on the spot, towards a sideways velocity, and along a curve."""

import math
import statistics
from collections.abc import Sequence

from rover_sim.compare.driver import Step
from rover_sim.compare.figure import (
    ANGLE,
    DISTANCE,
    TIME,
    YAW_RATE,
    Figure,
    Group,
    turned,
    turned_either_way,
)
from rover_sim.compare.manoeuvres import BEND, SIDEWAYS, SPOT_TURNS, THEN_ZEROS
from rover_sim.compare.trace import Span, Trace, TruePose, path_length


def figures(trace: Trace) -> list[Figure]:
    """Return the figures of every turn in the trace."""
    steps = (*SPOT_TURNS, *SIDEWAYS, BEND)
    return [figure for step in steps for figure in _turn(trace, step)]


def _turn(trace: Trace, step: Step) -> list[Figure]:
    span = trace.span(step.name)
    if span is None:
        return []
    group = Group(f"Turn {step.name}")
    poses = trace.true_poses(span)
    if step.yaw_rate:
        _add_rate(group, poses, step, span)
    peak = max(abs(pose.yaw_rate) for pose in poses)
    group.add("peak rate", math.degrees(peak), YAW_RATE)
    group.add("turned", turned([pose.yaw for pose in poses]), ANGLE)
    group.add("way made meanwhile", path_length(poses), DISTANCE)
    zeros = trace.span(step.name + THEN_ZEROS)
    if zeros is not None:
        after = [pose.yaw for pose in trace.true_poses(zeros)]
        group.add("turned on after zeros", turned_either_way(after), ANGLE)
    return group.figures


def _add_rate(group: Group, poses: Sequence[TruePose], step: Step, span: Span) -> None:
    late = statistics.median(pose.yaw_rate for pose in poses[len(poses) // 2 :])
    group.add("rate reached", math.degrees(late), YAW_RATE)
    sign = math.copysign(1.0, step.yaw_rate)
    enough = 0.63 * abs(step.yaw_rate)
    reached = (pose.time for pose in poses if pose.yaw_rate * sign >= enough)
    after = next((at - span.begin for at in reached), None)
    group.add("reaches 63 % of the rate asked", after, TIME)
