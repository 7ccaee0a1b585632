"""The result of a rover's checks before arming, in SYS_STATUS. MAVLink: MAV_SYS_STATUS_SENSOR."""

from mav_tasks.mavlink.messages import SysStatus

PREARM_CHECK = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK


def passes_checks(message: SysStatus) -> bool | None:
    """Return whether the checks pass; None: the rover does not report them."""
    is_healthy = bool(message.onboard_control_sensors_health & PREARM_CHECK)
    # PX4 1.17 sets the bit in health only
    is_reported = is_healthy or bool(message.onboard_control_sensors_present & PREARM_CHECK)
    return is_healthy if is_reported else None
