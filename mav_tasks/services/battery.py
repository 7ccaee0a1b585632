"""A rover's charge, as SYS_STATUS reports it."""

from mav_tasks.mavlink.messages import SysStatus

UNKNOWN = -1  # battery_remaining


def charge_of(message: SysStatus) -> float | None:
    """Return the charge that is left, 0 to 1; None: the rover does not know it."""
    percent = message.battery_remaining
    return None if percent == UNKNOWN else min(max(percent / 100, 0.0), 1.0)
