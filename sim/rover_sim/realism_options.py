"""Options of the command line that need parsing: a rover's start and its transmitter."""

from math import isfinite, radians
from typing import NamedTuple

from typer import BadParameter

from rover_sim.body import wrap_angle
from rover_sim.geo import DEFAULT_ORIGIN, Origin

HOME_FIELDS = 4
PULSES = (800, 2200)  # µs, the range of a receiver


class Place(NamedTuple):
    """Start of a rover, and the origin of its local frame."""

    origin: Origin = DEFAULT_ORIGIN
    yaw: float = 0.0  # rad, clockwise from north


class StickPulses(NamedTuple):
    """The transmitter's pulses, µs."""

    throttle: int
    steering: int = 1500


def read_place(text: str) -> Place:
    """Parse ``--home``. Raise BadParameter."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != HOME_FIELDS or not all(map(isfinite, numbers)):
        raise BadParameter(f"must be LAT,LON,ALT,HEADING in numbers, not {text!r}")
    latitude, longitude, altitude, heading = numbers
    if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0):  # at a pole there is no east
        raise BadParameter("latitude is within 90 degrees, longitude within 180")
    return Place(Origin(latitude, longitude, altitude), wrap_angle(radians(heading)))


def read_sticks(text: str) -> StickPulses:
    """Parse ``--sticks``. Raise BadParameter."""
    least, most = PULSES
    parts = text.split(",")
    if not 1 <= len(parts) <= len(StickPulses._fields) or not all(
        part.isdecimal() and least <= int(part) <= most for part in parts
    ):
        raise BadParameter(f"must be one or two pulses of {least} to {most}")
    return StickPulses(*map(int, parts))
