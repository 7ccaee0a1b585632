"""The origin of each rover's local frame on earth, for the map. Pure.

It is computed from the local and the global position of a rover that stands. While it drives, the
two are of different moments.
"""

from math import cos, hypot, radians

from mav_tasks.client.values import VehicleStatus
from mav_tasks.web.goal_places import Place

METRES_PER_DEGREE = 111_318.845  # as dialects/README.md converts places
STANDS = 0.05  # m/s
MOVED = 2.0  # m; a new origin, not noise


class Origins:
    """The origins of all rovers."""

    def __init__(self) -> None:
        self._places: dict[int, Place] = {}

    def of(self, vehicle: VehicleStatus) -> Place | None:
        """Return a rover's origin; None: not known yet."""
        known = self._places.get(vehicle.id)
        if known is not None and (vehicle.speed is None or vehicle.speed > STANDS):
            return known
        found = _origin_of(vehicle)
        if found is not None and (known is None or _apart(known, found) > MOVED):
            self._places[vehicle.id] = found
        return self._places.get(vehicle.id)


def _origin_of(vehicle: VehicleStatus) -> Place | None:
    latitude, longitude = vehicle.latitude, vehicle.longitude
    if latitude is None or longitude is None or vehicle.north is None or vehicle.east is None:
        return None
    if not (latitude or longitude):
        return None
    south = latitude - vehicle.north / METRES_PER_DEGREE
    width = METRES_PER_DEGREE * cos(radians((latitude + south) / 2))
    return {"latitude": south, "longitude": longitude - vehicle.east / max(width, 1.0)}


def _apart(one: Place, other: Place) -> float:
    north = (one["latitude"] - other["latitude"]) * METRES_PER_DEGREE
    width = METRES_PER_DEGREE * cos(radians(one["latitude"]))
    return hypot(north, (one["longitude"] - other["longitude"]) * width)
