"""Local metres to global degrees and back, flat around an origin, as ArduPilot computes it."""

import math
from dataclasses import dataclass

METRES_PER_DEGREE = 111_318.84502145034  # ArduPilot's LOCATION_SCALING_FACTOR


@dataclass(frozen=True, slots=True)
class Origin:
    """The zero point of the local frame. Degrees, and metres above mean sea level."""

    latitude: float
    longitude: float
    altitude: float

    @property
    def in_degrees_e7(self) -> tuple[int, int]:
        """Latitude and longitude in degE7."""
        return round(self.latitude * 1e7), round(self.longitude * 1e7)

    def to_global(self, north: float, east: float) -> tuple[int, int]:
        """Return latitude and longitude in degE7."""
        latitude = self.latitude + north / METRES_PER_DEGREE
        longitude = self.longitude + east / self._metres_per_degree_east(latitude)
        return round(latitude * 1e7), round(longitude * 1e7)

    def to_global_cut(self, north: float, east: float) -> tuple[int, int]:
        """Return latitude and longitude in degE7, with truncated offsets like ArduPilot.

        (Location::offset.) An origin computed from such a position can be 1 degE7 off.
        """
        latitude = self.latitude + north / METRES_PER_DEGREE
        x, y = self.in_degrees_e7
        return (
            x + int(north / METRES_PER_DEGREE * 1e7),
            y + int(east / self._metres_per_degree_east(latitude) * 1e7),
        )

    def to_local(self, latitude_degE7: int, longitude_degE7: int) -> tuple[float, float]:
        """Return north and east in metres."""
        latitude = latitude_degE7 * 1e-7
        return (
            (latitude - self.latitude) * METRES_PER_DEGREE,
            (longitude_degE7 * 1e-7 - self.longitude) * self._metres_per_degree_east(latitude),
        )

    def _metres_per_degree_east(self, latitude: float) -> float:
        """Return metres per degree of longitude, at the mean of the origin's and this latitude."""
        return METRES_PER_DEGREE * math.cos(math.radians((self.latitude + latitude) / 2))


def is_on_earth(latitude_degE7: float, longitude_degE7: float) -> bool:
    """Return whether these are coordinates; NaN is none."""
    return abs(latitude_degE7) <= 900_000_000 and abs(longitude_degE7) <= 1_800_000_000


DEFAULT_ORIGIN = Origin(-35.363262, 149.165237, 584.0)  # where ArduPilot's SITL starts
