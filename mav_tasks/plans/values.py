"""What a mission file says, in the units of MISSION_ITEM_INT; home is kept apart from the items.

The first parameter of a DO_JUMP is an index into ``PlanFile.items``, from 0, whatever the file
counted in: who sends home as item 0, as to ArduPilot, adds one to it.
"""

from collections.abc import Iterator
from dataclasses import astuple, dataclass
from typing import NamedTuple

from mav_tasks.mavlink.enums import MavCmd, MavFrame

NO_PARAMS = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class PlanItem:  # noqa: PLW1641 - the decorator adds it
    """One item to send. NaN in ``params`` and ``z`` is "not given".

    ``x`` and ``y`` are degE7 in global frames, m × 1e4 in local ones, plain numbers in the frame
    MISSION, and 0 where the file gives none. ``z`` is in m.
    """

    command: int
    frame: int
    params: tuple[float, float, float, float]
    x: int
    y: int
    z: float
    autocontinue: bool

    def __eq__(self, other: object) -> bool:
        """Compare as tuples do: what is not given in both is equal, also from Python 3.13 on."""
        return isinstance(other, PlanItem) and astuple(self) == astuple(other)


class GeoPoint(NamedTuple):
    """A place; the altitude (m) is above mean sea level for home, above home for rally points."""

    latitude_degE7: int
    longitude_degE7: int
    altitude: float


@dataclass(frozen=True, slots=True)
class FencePolygon:
    """Where to stay inside (inclusion) or outside: three or more (latitude, longitude), degE7."""

    inclusion: bool
    vertices: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class FenceCircle:
    """Where to stay inside (inclusion) or outside: (latitude, longitude), degE7, and m."""

    inclusion: bool
    center: tuple[int, int]
    radius: float


@dataclass(frozen=True, slots=True)
class PlanFile:
    """A whole file. ``home`` is where the planner took it to be; None if the file does not say."""

    items: tuple[PlanItem, ...]
    home: GeoPoint | None
    fence: tuple[FencePolygon | FenceCircle, ...]
    rally: tuple[GeoPoint, ...]


def fence_items(plan: PlanFile) -> tuple[PlanItem, ...]:
    """Return the fence as it is sent: an item for each vertex or circle, in the file's order."""
    return tuple(item for part in plan.fence for item in _items_of(part))


def rally_items(plan: PlanFile) -> tuple[PlanItem, ...]:
    """Return the rally points as they are sent."""
    command, frame = MavCmd.NAV_RALLY_POINT, MavFrame.GLOBAL_RELATIVE_ALT
    return tuple(PlanItem(command, frame, NO_PARAMS, *point, False) for point in plan.rally)


def _items_of(part: FencePolygon | FenceCircle) -> Iterator[PlanItem]:
    """MAVLink guide, "Mission Protocol", geofence: param 1 is the number of vertices, or m."""
    points: tuple[tuple[int, int], ...]
    if isinstance(part, FencePolygon):
        inside = MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION
        outside = MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
        points, size = part.vertices, float(len(part.vertices))
    else:
        inside = MavCmd.NAV_FENCE_CIRCLE_INCLUSION
        outside = MavCmd.NAV_FENCE_CIRCLE_EXCLUSION
        points, size = (part.center,), part.radius
    command = inside if part.inclusion else outside
    for x, y in points:
        yield PlanItem(command, MavFrame.GLOBAL, (size, 0.0, 0.0, 0.0), x, y, 0.0, False)
