"""Places and poses of a vehicle, and pieces of its way. SI units and radians."""

from dataclasses import dataclass

from mav_tasks.kinds.sent import LARGEST
from mav_tasks.mavlink.enums import MavFrame

LOCAL_SCALE = 1e4  # x and y in a local frame are in units of 0.1 mm


@dataclass(frozen=True, slots=True)
class LocalPlace:
    """A place in the vehicle's own local frame, metres north and east of its origin."""

    north: float
    east: float

    @property
    def sent(self) -> tuple[int, int, int]:
        """Frame, x and y of an item. Raise ValueError if it is too far away."""
        x, y = round(self.north * LOCAL_SCALE), round(self.east * LOCAL_SCALE)
        if max(abs(x), abs(y)) > LARGEST:
            raise ValueError(f"{self}: too far away for a mission item")
        return MavFrame.LOCAL_NED, x, y


@dataclass(frozen=True, slots=True)
class GlobalPlace:
    """A place on earth, exactly as MAVLink's integers give it."""

    latitude_degE7: int
    longitude_degE7: int

    @property
    def sent(self) -> tuple[int, int, int]:
        """Frame, x and y of an item."""
        return MavFrame.GLOBAL, self.latitude_degE7, self.longitude_degE7


Place = LocalPlace | GlobalPlace


@dataclass(frozen=True, slots=True)
class Pose:
    """A vehicle's pose in its local frame: metres north and east, yaw in radians."""

    north: float
    east: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Bend:
    """A piece of a path: ``length`` m of arc or straight line, negative if driven backwards.

    ``curvature`` in 1/m, positive where driving forwards turns clockwise, 0 = straight.
    """

    curvature: float
    length: float
