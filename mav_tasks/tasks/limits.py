"""The last word before a setpoint leaves: finite, not too fast, not too suddenly faster.

Zeros pass at once and unramped: they are STOP, cancel and faults.
"""

from math import isfinite

from mav_tasks.settings import Driving
from mav_tasks.tasks.guidance import ZERO, Velocity


def limited(wish: Velocity, last: Velocity, *, driving: Driving, elapsed: float) -> Velocity:
    """Give what may be sent ``elapsed`` seconds after ``last``.

    Speeding up is ramped at the settings' accelerations, slowing down is not. A number that is not
    finite becomes a stop: NaN in a velocity setpoint aborts an ArduPilot SITL.
    """
    if wish.is_zero or not (isfinite(wish.forward) and isfinite(wish.yaw_rate)):
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
    )


def _ramped(wish: float, last: float, *, top: float, step: float) -> float:
    wish = max(-top, min(top, wish))
    if wish >= 0:
        return min(wish, max(last, 0.0) + step)
    return max(wish, min(last, 0.0) - step)
