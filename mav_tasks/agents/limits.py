"""Limits of what agents may submit, beyond those of the server. Pure.

They hold before a submission is sent. The server's own limits, by role, hold in any case.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

from mav_tasks.client.goal_form import DEGREE
from mav_tasks.client.values import VehicleStatus
from mav_tasks.client.wire import Goal
from mav_tasks.errors import UsageError
from mav_tasks.tasks.frames import to_local
from mav_tasks.tasks.goal import Drive, GlobalPlace, GoTo, LocalPlace, Move, Place


@dataclass(frozen=True, slots=True)
class Limits:
    """``max_distance``: m that one task may drive; ``max_speed`` in m/s; None: no limit.

    ``max_queued``: tasks of the rover that may wait or run, with the new one.
    """

    max_distance: float | None = None
    max_speed: float | None = None
    max_queued: int | None = None

    def check_distance(self, goals: Sequence[Goal], *, rover: VehicleStatus) -> None:
        """Raise UsageError if the goals may drive a rover too far from where it is now."""
        if self.max_distance is None:
            return
        farthest = _farthest(goals, rover)
        if farthest > self.max_distance:
            limit = f"--max-distance {self.max_distance:g} m"
            raise UsageError(f"{limit}: this task may drive {farthest:.1f} m")

    def check_speed(self, goals: Sequence[Goal]) -> None:
        """Raise UsageError if a goal drives too fast, or does not say how fast."""
        if self.max_speed is None:
            return
        limit = f"--max-speed {self.max_speed:g} m/s"
        for goal in goals:
            match goal:
                case Move(speed=speed) | GoTo(speed=speed):
                    if not speed:  # 0 is the server's default, too
                        raise UsageError(f"{limit}: name the speed of each goal that drives")
                case Drive(forward=speed):
                    pass
                case _:
                    continue
            if abs(speed) > self.max_speed:
                raise UsageError(f"{limit}: a goal asks for {speed:g} m/s")

    def check_queue(self, queued: int) -> None:
        """Raise UsageError if a rover has ``max_queued`` tasks already."""
        if self.max_queued is not None and queued >= self.max_queued:
            words = f"--max-queued {self.max_queued}: the rover has {queued} tasks; wait for one"
            raise UsageError(words)

    def words(self) -> str:
        """Return the limits as a sentence for agents; "" without limits."""
        each = {
            "m of driving in one task": self.max_distance,
            "m/s, and each goal that drives must name its speed": self.max_speed,
            "tasks of a rover at a time": self.max_queued,
        }
        named = [f"{limit:g} {what}" for what, limit in each.items() if limit is not None]
        return f"Limits here: {'; '.join(named)}." if named else ""


def _farthest(goals: Sequence[Goal], rover: VehicleStatus) -> float:
    """Return how far the goals can drive, m. Raise UsageError if that is unknown."""
    driven, place, off = 0.0, _place_of(rover), 0.0  # off: how far it may be from the place
    for goal in goals:
        match goal:
            case Move(distance=distance):
                way = abs(distance)
                off += way
            case Drive(forward=forward, duration=duration):
                way = abs(forward) * duration
                off += way
            case GoTo(place=to):
                there = _local(to, rover)
                if place is None or there is None:
                    what = "the rover's home" if to is None else "the rover's position"
                    words = f"--max-distance cannot be checked: {what} is not known here"
                    raise UsageError(words)
                way = hypot(there.north - place.north, there.east - place.east) + off
                place, off = there, 0.0
            case _:
                way = 0.0
        driven += way
    return driven


def _place_of(rover: VehicleStatus) -> LocalPlace | None:
    if rover.north is None or rover.east is None:
        return None
    return LocalPlace(rover.north, rover.east)


def _local(place: Place | None, rover: VehicleStatus) -> LocalPlace | None:
    """Return a place in the rover's local frame; None if that is not known."""
    here = _place_of(rover)
    if not isinstance(place, GlobalPlace):
        return place
    if here is None or rover.latitude is None or rover.longitude is None:
        return None
    on_earth = GlobalPlace(round(rover.latitude * DEGREE), round(rover.longitude * DEGREE))
    way = to_local(place, on_earth)
    return LocalPlace(here.north + way.north, here.east + way.east)
