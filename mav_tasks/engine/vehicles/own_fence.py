"""Whether a vehicle reports that it is outside its own fence: SYS_STATUS, at 1 Hz.

ArduPilot (4.6.3) reports its fence as healthy unless it is breached. It stays breached until the
rover is back inside or the fence is switched off. No text reports it. PX4 1.17 has no such bit:
only its mode shows a breach.
"""

from mav_tasks.mavlink.messages import SysStatus

GEOFENCE = 0x100000  # MAV_SYS_STATUS_GEOFENCE


def is_breached(status: SysStatus) -> bool:
    """Return whether a fence that is switched on is reported as unhealthy."""
    is_on = status.onboard_control_sensors_enabled & GEOFENCE
    return bool(is_on) and not status.onboard_control_sensors_health & GEOFENCE
