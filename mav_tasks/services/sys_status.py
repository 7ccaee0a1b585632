"""What a rover says of itself in SYS_STATUS: its charge, its checks before arming, its own fence.

MAVLink common: MAV_SYS_STATUS_SENSOR.
"""

from mav_tasks.mavlink.messages import SysStatus

UNKNOWN = -1  # battery_remaining
GEOFENCE, PREARM_CHECK = 0x100000, 0x10000000  # MAV_SYS_STATUS_…


def charge_of(message: SysStatus) -> float | None:
    """Return the charge that is left, 0 to 1; None: the rover does not know it."""
    percent = message.battery_remaining
    return None if percent == UNKNOWN else min(max(percent / 100, 0.0), 1.0)


def passes_checks(message: SysStatus) -> bool | None:
    """Return whether the checks pass; None: the rover does not report them."""
    is_healthy = bool(message.onboard_control_sensors_health & PREARM_CHECK)
    # PX4 1.17 sets the bit in health only
    is_reported = is_healthy or bool(message.onboard_control_sensors_present & PREARM_CHECK)
    return is_healthy if is_reported else None


def is_outside_fence(message: SysStatus) -> bool:
    """Return whether a fence that is switched on is reported as unhealthy."""
    is_on = message.onboard_control_sensors_enabled & GEOFENCE
    return bool(is_on) and not message.onboard_control_sensors_health & GEOFENCE
