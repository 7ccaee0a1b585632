"""Converts global places to a vehicle's local frame and back, with ArduPilot's own mapping.

A degree of latitude is 111,318.845 m everywhere. A degree of longitude is that times the cosine of
the mean of the two latitudes (AP_Common/Location, ``get_distance_NE``). The results are compared
with the autopilot's LOCAL_POSITION_NED, so that they must use its formula: on an ellipsoid the same
two places are metres apart at 10 km.
"""

from math import cos, radians

from mav_tasks.kinds import GlobalPlace, LocalPlace, Place

METRES_PER_DEGE7 = 0.011131884502145034
HALF_TURN = 1_800_000_000  # degE7


def to_local(place: GlobalPlace, origin: GlobalPlace) -> LocalPlace:
    """Return a place in the local frame with this origin; exact to a millimetre within 10 km."""
    east = _wrapped(place.longitude_degE7 - origin.longitude_degE7)
    scale = _east_scale(place.latitude_degE7, origin.latitude_degE7)
    return LocalPlace(
        (place.latitude_degE7 - origin.latitude_degE7) * METRES_PER_DEGE7,
        east * METRES_PER_DEGE7 * scale,
    )


def local_place(place: Place | None, origin: GlobalPlace | None) -> LocalPlace | None:
    """Return a place of either kind in the local frame, or None while it is not known there."""
    if isinstance(place, GlobalPlace):
        return None if origin is None else to_local(place, origin)
    return place


def to_global(place: LocalPlace, origin: GlobalPlace) -> GlobalPlace:
    """Return the nearest global place; its integers resolve 11 mm."""
    latitude = origin.latitude_degE7 + place.north / METRES_PER_DEGE7
    scale = _east_scale(latitude, origin.latitude_degE7)
    longitude = origin.longitude_degE7 + place.east / (METRES_PER_DEGE7 * scale)
    return GlobalPlace(round(latitude), _wrapped(round(longitude)))


def origin_of(place: GlobalPlace, local: LocalPlace) -> GlobalPlace:
    """Return the origin of a frame in which ``local`` is the same place as ``place``."""
    latitude = place.latitude_degE7 - local.north / METRES_PER_DEGE7
    scale = _east_scale(place.latitude_degE7, latitude)
    longitude = place.longitude_degE7 - local.east / (METRES_PER_DEGE7 * scale)
    return GlobalPlace(round(latitude), _wrapped(round(longitude)))


def _east_scale(one_degE7: float, other_degE7: float) -> float:
    return max(0.01, cos(radians((one_degE7 + other_degE7) / 2e7)))


def _wrapped(longitude_degE7: int) -> int:
    """Return a longitude or a difference of longitudes within ±180°."""
    return (longitude_degE7 + HALF_TURN) % (2 * HALF_TURN) - HALF_TURN
