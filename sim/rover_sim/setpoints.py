"""SET_POSITION_TARGET_*: which of them ArduPilot Rover accepts, and how it interprets them.

Parsing only, as observed on Rover 4.6.3; they get no answers. The mask's bits act in groups: one
set bit of a pair or triple ignores the whole group.
"""

import math
from typing import NamedTuple

from mav_tasks.mavlink import messages
from mav_tasks.mavlink.enums import MavFrame
from rover_sim.body import turned, wrap_angle
from rover_sim.errors import SimulatedCrash
from rover_sim.estimate import Estimate
from rover_sim.geo import Origin, is_on_earth

# POSITION_TARGET_TYPEMASK
POSITION_IGNORED = 0x0003  # x or y
VELOCITY_IGNORED = 0x0018  # vx or vy; vz is unused on the ground
ACCELERATION_IGNORED = 0x01C0  # any axis
YAW_IGNORED = 0x0400
YAW_RATE_IGNORED = 0x0800

BODY_FRAMES = (MavFrame.BODY_NED, MavFrame.BODY_OFFSET_NED)
LOCAL_FRAMES = (MavFrame.LOCAL_NED, MavFrame.LOCAL_OFFSET_NED, *BODY_FRAMES)
GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)  # GLOBAL, relative and terrain altitude, and their INT forms


class Heading(NamedTuple):
    """Drive at a speed while keeping a heading."""

    yaw: float  # rad from north
    speed: float  # m/s, negative is backwards


class TurnRate(NamedTuple):
    """Drive at a speed while turning at a rate."""

    yaw_rate: float  # rad/s, clockwise
    speed: float


class Destination(NamedTuple):
    """Drive to a point of the local frame and stop there."""

    north: float
    east: float


Target = Heading | TurnRate | Destination
Local = messages.SetPositionTargetLocalNed
Global = messages.SetPositionTargetGlobalInt


def read_setpoint(
    message: Local | Global, estimate: Estimate, origin: Origin, *, speed_limit: float
) -> Target | None:
    """Return the target of a setpoint; None if Rover drops it silently."""
    has_place = not message.type_mask & POSITION_IGNORED
    frame = message.coordinate_frame
    if isinstance(message, Global):
        if frame not in GLOBAL_FRAMES:
            return None
        if has_place:
            return read_place(message.lat_int, message.lon_int, origin)
        return _read_motion(message, 0.0, speed_limit)
    if frame not in LOCAL_FRAMES:
        return None
    base_yaw = estimate.yaw if frame in BODY_FRAMES else 0.0
    if not has_place:
        return _read_motion(message, base_yaw, speed_limit)
    _abort_on_nan(message.x, message.y)
    if frame == MavFrame.LOCAL_NED:
        return Destination(message.x, message.y)
    north, east = turned(message.x, message.y, base_yaw)
    return Destination(estimate.north + north, estimate.east + east)


def read_place(latitude_degE7: int, longitude_degE7: int, origin: Origin) -> Destination | None:
    """Return the place in the local frame, or None if the coordinates are out of range.

    0/0 means "not given", as in most of ArduPilot's commands.
    """
    if latitude_degE7 == 0 and longitude_degE7 == 0:
        return None
    if not is_on_earth(latitude_degE7, longitude_degE7):
        return None
    return Destination(*origin.to_local(latitude_degE7, longitude_degE7))


def _read_motion(message: Local | Global, base_yaw: float, speed_limit: float) -> Target | None:
    mask = message.type_mask
    if not mask & ACCELERATION_IGNORED:
        return None
    yaw_given = not mask & YAW_IGNORED
    rate_given = not mask & YAW_RATE_IGNORED
    if yaw_given and rate_given:
        return None
    yaw, speed = base_yaw, 0.0
    if not mask & VELOCITY_IGNORED:
        _abort_on_nan(message.vx, message.vy)
        speed = min(math.hypot(message.vx, message.vy), speed_limit)
        yaw = base_yaw + math.atan2(message.vy, message.vx)
        if (yaw_given or rate_given) and message.vx < 0.0:
            speed = -speed  # only with a yaw or yaw rate; else the rover turns round
    elif not (yaw_given or rate_given):
        return None
    if rate_given:
        _abort_on_nan(message.yaw_rate)
        return TurnRate(message.yaw_rate, speed)
    if yaw_given:
        _abort_on_nan(message.yaw)
        yaw = base_yaw + message.yaw
    return Heading(wrap_angle(yaw), speed)


def _abort_on_nan(*values: float) -> None:
    """Raise SimulatedCrash on NaN.

    The real one aborts with SIGFPE (SITL) or reports internal error 0x400 (hardware).
    """
    if any(math.isnan(value) for value in values):
        raise SimulatedCrash("NaN in a setpoint: ArduPilot aborts with a floating point exception")
