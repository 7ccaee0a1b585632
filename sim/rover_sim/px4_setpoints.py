"""SET_POSITION_TARGET_*: how a PX4 rover interprets them. Parsing only; they get no answers.

After the receiver of PX4 1.15 to 1.17: a field is given if its own bit of the mask is clear and it
is a number (NaN is "not given", and harmless). BODY_NED has velocities only, and needs all three
axes.
"""

import math
from typing import NamedTuple

from mav_tasks.mavlink.enums import MavFrame
from rover_sim.body import turned, wrap_angle
from rover_sim.estimate import Estimate
from rover_sim.geo import Origin
from rover_sim.setpoints import Destination, Global, Heading, Local, Target, TurnRate

# POSITION_TARGET_TYPEMASK, the bits of the first of three axes
X, VX, AX = 1, 8, 64
FORCE = 512
YAW_RATE_IGNORED = 2048
GLOBAL_INT_FRAMES = (5, 6, 11)  # only the INT forms

Vector = tuple[float | None, float | None, float | None]


class Setpoint(NamedTuple):
    """A setpoint that keeps the stream alive, even if a rover cannot drive it."""

    target: Target | None  # None: stop (an acceleration, or an incomplete place or velocity)
    speed: float | None = None  # m/s towards a place, if the setpoint has one


NOTHING: Vector = (None, None, None)


def read_px4(
    message: Local | Global, estimate: Estimate, origin: Origin, *, yaw_rate: bool
) -> Setpoint | str:
    """Parse a setpoint; return a text if it does not count as one.

    ``yaw_rate``: whether the rover honours a yaw rate in BODY_NED. Yaw is ignored.
    """
    mask, frame, position = message.type_mask, message.coordinate_frame, NOTHING
    velocity = _given(mask, VX, (message.vx, message.vy, message.vz))
    acceleration = _given(mask, AX, (message.afx, message.afy, message.afz))
    if isinstance(message, Global):
        if not mask & (X | X << 1 | X << 2):
            if frame not in GLOBAL_INT_FRAMES:
                return f"Setpoint frame {frame} unsupported"
            position = (*origin.to_local(message.lat_int, message.lon_int), 0.0)
    elif frame == MavFrame.LOCAL_NED:
        position = _given(mask, X, (message.x, message.y, message.z))
    elif frame == MavFrame.BODY_NED:
        forward, right, down = velocity
        velocity = NOTHING
        if forward is not None and right is not None and down is not None:
            rate = message.yaw_rate
            if yaw_rate and not mask & YAW_RATE_IGNORED and math.isfinite(rate):
                return Setpoint(TurnRate(rate, forward))
            velocity = (*turned(forward, right, estimate.yaw), down)
    else:
        return f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {frame} unsupported"
    if acceleration != NOTHING and mask & FORCE:
        return "Setpoint with force unsupported"
    if position == velocity == acceleration == NOTHING:
        return "Setpoint invalid: nothing given"
    return _setpoint(position, velocity)


def _given(mask: int, first_bit: int, values: tuple[float, float, float]) -> Vector:
    x, y, z = (
        value if not mask & first_bit << axis and math.isfinite(value) else None
        for axis, value in enumerate(values)
    )
    return x, y, z


def _setpoint(position: Vector, velocity: Vector) -> Setpoint:
    north, east, _ = position
    vn, ve, _ = velocity
    speed = math.hypot(vn, ve) if vn is not None and ve is not None else None
    if north is not None and east is not None:
        return Setpoint(Destination(north, east), speed or None)
    if speed is None or vn is None or ve is None:
        return Setpoint(None)
    # A rover never drives backwards: it turns round and drives where the vector points. Zero
    # velocity has a course, too, by the signs of its zeros, to which the real one turns.
    yaw = math.atan2(ve, vn)
    return Setpoint(Heading(wrap_angle(yaw), speed))
