"""What a DO_SET_HOME means: a place, or the vehicle's position. MAVLink guide, MAV_CMD 179."""

from math import isfinite

from mav_tasks.mavlink import messages as m
from mav_tasks.tasks.goal import GlobalPlace

PRESENT = 1.0  # param1: use the vehicle's position


def home_meant(command: m.Message) -> GlobalPlace | None:
    """Return the place that a command names, or None if it means the vehicle's position."""
    if isinstance(command, m.CommandInt) and command.param1 != PRESENT:
        return GlobalPlace(command.x, command.y)
    if isinstance(command, m.CommandLong) and command.param1 != PRESENT:
        latitude, longitude = command.param5, command.param6
        if isfinite(latitude) and isfinite(longitude):
            return GlobalPlace(round(latitude * 1e7), round(longitude * 1e7))
    return None
