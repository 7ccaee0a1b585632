"""Where rovers have been: the last hours in memory, thinned. Pure."""

from collections import deque
from math import degrees, hypot

from mav_tasks.client.values import VehicleStatus

MOST = 20_000  # points of one rover
APART = 0.1  # m between two points
AT_LEAST = 10.0  # s between two points of a rover that stands

#: time (UTC seconds), north, east (m), heading (deg), id of the task that was driven
Point = tuple[float, float, float, float | None, int | None]


class Tracks:
    """The tracks of all rovers."""

    def __init__(self) -> None:
        self._points: dict[int, deque[Point]] = {}

    def __repr__(self) -> str:
        return f"Tracks({ {rover: len(points) for rover, points in self._points.items()} })"

    def add(self, vehicle: VehicleStatus, *, task: int | None, at: float) -> None:
        """Add a rover's place, unless it is close to the last one in place and time."""
        if vehicle.north is None or vehicle.east is None:
            return
        points = self._points.setdefault(vehicle.id, deque(maxlen=MOST))
        if points:
            last = points[-1]
            moved = hypot(vehicle.north - last[1], vehicle.east - last[2])
            if moved < APART and at - last[0] < AT_LEAST and task == last[4]:
                return
        heading = None if vehicle.yaw is None else round(degrees(vehicle.yaw) % 360.0, 1)
        points.append(
            (round(at, 2), round(vehicle.north, 3), round(vehicle.east, 3), heading, task)
        )

    def of_vehicle(self, vehicle: int, *, since: float = 0.0) -> list[Point]:
        """Return a rover's points, the oldest first."""
        return [point for point in self._points.get(vehicle, ()) if point[0] >= since]

    def of_task(self, task: int) -> list[Point]:
        """Return the points at which a rover drove a task."""
        return [point for points in self._points.values() for point in points if point[4] == task]
