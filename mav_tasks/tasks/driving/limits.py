"""The last word before a setpoint leaves: finite, not too fast, not too suddenly faster.

Zeros pass at once and unramped: they are STOP, cancel and faults.
"""

from dataclasses import replace
from math import ceil, copysign, isfinite, sqrt

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.fence import LocalFence
from mav_tasks.tasks.driving.guidance import ZERO, Motion, Velocity, wrap

MARGIN = 0.05  # m left between a vehicle and its fence
LATENCY = 0.3  # s in which a vehicle does not yet do what it is told; what it says is that old, too
USUAL_AGE = 0.05  # s, of telemetry: as much is in LATENCY; if older, the way since then counts
TURNS_ON = LATENCY + 0.3  # s in which a vehicle that is told to stand still turns
APART = 0.1  # rad, at the most, between directions that are looked in
CREEP = 0.02  # m/s; slower than this is standing


def within_fence(
    wish: Velocity, motion: Motion, fence: LocalFence | None, *, driving: Driving, now: float
) -> Velocity | None:
    """Return what may be asked for so that the vehicle can stop before the fence; None: stop now.

    It goes by the room ahead, or behind for one that reverses, in every direction in which the
    vehicle may point until it stands; and it has driven on since it was measured.
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
    """Return directions, close to each other, in which a vehicle may point until it stands."""
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
    """Return what may be sent ``elapsed`` seconds after ``last``.

    Speeding up is ramped at the settings' accelerations, slowing down is not. A number that is not
    finite becomes a stop: NaN in a velocity setpoint aborts an ArduPilot SITL.
    """
    if wish.is_zero or not (isfinite(wish.forward) and isfinite(wish.yaw_rate)):
        return ZERO
    if wish.course is not None and not isfinite(wish.course):
        return ZERO
    return Velocity(
        _ramped(
            wish.forward,
            last.forward,
            top=driving.max_speed,
            step=driving.acceleration * elapsed,
        ),
        _ramped(
            wish.yaw_rate,
            last.yaw_rate,
            top=driving.max_turn_rate,
            step=driving.turn_acceleration * elapsed,
        ),
        wish.course,
    )


def safe_braking(driving: Driving, speed: float, distance: float) -> float:
    """Return the deceleration to plan for where a stop from ``speed`` took ``distance``.

    The settings', or less if it took more room than is planned for; all of it counts as braking
    then, for a lag at low speed says little of a higher one. It makes more careful, never less.
    """
    planned = driving.acceleration
    if distance <= speed * LATENCY + speed * speed / (2 * planned):
        return planned
    return min(planned, speed * speed / (2 * distance))


def _ramped(wish: float, last: float, *, top: float, step: float) -> float:
    wish = max(-top, min(top, wish))
    if wish >= 0:
        return min(wish, max(last, 0.0) + step)
    return max(wish, min(last, 0.0) - step)
