"""Limits on a velocity before it is sent: finite, not too fast, ramped up, clear of the fence.

Zeros pass at once and without a ramp: they are STOP, cancel and faults.
"""

from dataclasses import replace
from math import ceil, copysign, isfinite, sqrt

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.fence import LocalFence
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity, clamped, wrap

MARGIN = 0.05  # m left between a vehicle and its fence
LATENCY = 0.3  # s until a vehicle does what it is told, including the age of its telemetry
USUAL_AGE = 0.05  # s of telemetry age in LATENCY; if it is older, the way since then counts
TURNS_ON = LATENCY + 0.3  # s for which a vehicle that is told to stand keeps turning
APART = 0.1  # rad, at most, between the directions that are checked
CREEP = 0.02  # m/s; less counts as standing


def within_fence(
    wish: Velocity, motion: Motion, fence: LocalFence | None, *, driving: Driving, now: float
) -> Velocity | None:
    """Return a velocity from which the vehicle can stop before the fence; None: stop now.

    It checks the room ahead, or behind in reverse, in every direction that the vehicle may point in
    until it stands. The distance driven since the measurement is deducted.
    """
    if fence is None or wish.forward == 0.0:
        return wish
    ahead = wish.forward > 0.0
    speed, braking = abs(wish.forward), driving.acceleration
    unseen = max(speed, abs(motion.forward)) * max(0.0, now - motion.at - USUAL_AGE)
    lost = unseen + MARGIN
    needed = speed * LATENCY + speed * speed / (2 * braking) + lost
    room = needed
    for yaw in _headings(wish, motion):
        room = min(room, fence.room(replace(motion.pose, yaw=yaw), forward=ahead, limit=room))
    room -= lost
    if room >= needed - lost:
        return wish
    lag = braking * LATENCY
    most = sqrt(lag * lag + 2 * braking * max(room, 0.0)) - lag
    return None if most < CREEP else replace(wish, forward=copysign(most, wish.forward))


def _headings(wish: Velocity, motion: Motion) -> list[float]:
    """Return closely spaced headings that a vehicle may have until it stands."""
    yaw = motion.pose.yaw
    if wish.course is not None:  # it turns there by itself, as fast as it can
        turns = [0.0, wrap(wish.course - yaw)]
    else:
        turns = [0.0, wish.yaw_rate * TURNS_ON, motion.yaw_rate * TURNS_ON]
    least, most = min(turns), max(turns)
    steps = ceil((most - least) / APART)
    spread = (most - least) / steps if steps else 0.0
    return [yaw, *(yaw + least + number * spread for number in range(steps + 1))]


def limited(wish: Velocity, last: Velocity, *, driving: Driving, elapsed: float) -> Velocity:
    """Return the velocity that may be sent ``elapsed`` seconds after ``last``.

    Acceleration is ramped as the settings say, deceleration is not. A number that is not finite
    becomes a stop: NaN in a velocity setpoint aborts an ArduPilot SITL.
    """
    numbers = wish.forward, wish.yaw_rate, wish.course or 0.0
    if wish.is_zero or not all(map(isfinite, numbers)):
        return ZERO
    step, turn_step = driving.acceleration * elapsed, driving.turn_acceleration * elapsed
    return Velocity(
        _ramped(clamped(wish.forward, driving.max_speed), last.forward, step),
        _ramped(clamped(wish.yaw_rate, driving.max_turn_rate), last.yaw_rate, turn_step),
        wish.course,
    )


def safe_braking(driving: Driving, speed: float, distance: float) -> float:
    """Return the deceleration to plan for if a stop from ``speed`` took ``distance``.

    It is the settings' value, or less if the stop took more room than planned. The whole distance
    counts as braking then, since a lag at low speed says little about a higher one. The result is
    never above the settings' value.
    """
    planned = driving.acceleration
    if distance <= speed * LATENCY + speed * speed / (2 * planned):
        return planned
    return min(planned, speed * speed / (2 * distance))


def _ramped(wish: float, last: float, step: float) -> float:
    if wish >= 0:
        return min(wish, max(last, 0.0) + step)
    return max(wish, min(last, 0.0) - step)
