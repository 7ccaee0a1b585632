"""The last word before a setpoint leaves: finite, not too fast, not too suddenly faster.

Zeros pass at once and unramped: they are STOP, cancel and faults.
"""

from dataclasses import replace
from math import copysign, isfinite, sqrt

from mav_tasks.settings import Driving
from mav_tasks.tasks.fence import LocalFence
from mav_tasks.tasks.guidance import ZERO, Velocity
from mav_tasks.tasks.task import Pose

MARGIN = 0.05  # m left between a vehicle and its fence
LATENCY = 0.3  # s in which a vehicle does not yet do what it is told
CREEP = 0.02  # m/s; slower than this is standing


def within_fence(
    wish: Velocity, pose: Pose, fence: LocalFence | None, *, driving: Driving
) -> Velocity | None:
    """Give what may be asked for so that the vehicle can stop before the fence; None: stop now.

    It goes by the room straight ahead, or behind for one that reverses, and in its course.
    """
    if fence is None or wish.forward == 0.0:
        return wish
    ahead = wish.forward > 0.0
    speed, braking = abs(wish.forward), driving.acceleration
    needed = speed * LATENCY + speed * speed / (2 * braking) + MARGIN
    room = fence.room(pose, forward=ahead, limit=needed) - MARGIN
    if wish.course is not None:  # it turns there meanwhile
        turned = replace(pose, yaw=wish.course)
        room = min(room, fence.room(turned, forward=True, limit=needed) - MARGIN)
    if room >= needed - MARGIN:
        return wish
    lag = braking * LATENCY
    most = sqrt(lag * lag + 2 * braking * max(room, 0.0)) - lag
    return None if most < CREEP else replace(wish, forward=copysign(most, wish.forward))


def limited(wish: Velocity, last: Velocity, *, driving: Driving, elapsed: float) -> Velocity:
    """Give what may be sent ``elapsed`` seconds after ``last``.

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


def _ramped(wish: float, last: float, *, top: float, step: float) -> float:
    wish = max(-top, min(top, wish))
    if wish >= 0:
        return min(wish, max(last, 0.0) + step)
    return max(wish, min(last, 0.0) - step)
