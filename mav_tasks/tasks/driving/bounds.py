"""Where one vehicle may drive, and where it returns to: its fence and its rally points."""

from collections.abc import Sequence
from math import cos, sin

from mav_tasks.tasks.driving.fence import Fence, LocalFence
from mav_tasks.tasks.driving.legs import WAY, distance
from mav_tasks.tasks.driving.path import pose_on, rest_of
from mav_tasks.tasks.driving.planner import is_allowed
from mav_tasks.tasks.events import VehicleHomeSet
from mav_tasks.tasks.frames import local_place, to_local
from mav_tasks.tasks.goal import (
    Drive,
    GlobalPlace,
    GoTo,
    Head,
    Jump,
    LocalPlace,
    Move,
    MoveTurned,
    SingleGoal,
    Step,
)
from mav_tasks.tasks.task import Frame, Pose, Progress, same_frame


class Bounds:
    """The fence and the rally points of a vehicle; coordinates in the frame of an ``origin``."""

    def __init__(self) -> None:
        self.fence = Fence()
        self.rally: tuple[GlobalPlace, ...] = ()
        #: where it was first armed, or what a client has set; None: neither is known
        self.home: VehicleHomeSet | None = None
        self._local: LocalFence | None = None
        self._made_of: tuple[Fence, GlobalPlace] | None = None

    def __repr__(self) -> str:
        return f"Bounds({len(self.fence.zones)} zones, {len(self.rally)} rally points)"

    def home_in(self, frame: Frame | None) -> GlobalPlace | None:
        """Return the home of a vehicle in this frame; None: none is known since it booted."""
        home = self.home
        if home is None or not same_frame(home.frame, frame):
            return None
        return GlobalPlace(home.latitude_degE7, home.longitude_degE7)

    def is_unknown(self, origin: GlobalPlace | None) -> bool:
        """Whether there is a fence, and nobody knows where it is in the vehicle's frame."""
        return bool(self.fence.zones) and origin is None

    def local(self, origin: GlobalPlace | None) -> LocalFence | None:
        """Return the fence in the frame of an origin, None where there is none."""
        if origin is None or not self.fence.zones:
            return None
        if self._made_of != (self.fence, origin):
            self._local, self._made_of = LocalFence(self.fence, origin), (self.fence, origin)
        return self._local

    def allows(self, pose: Pose, origin: GlobalPlace | None) -> bool:
        """Whether a vehicle may be here."""
        fence = self.local(origin)
        return fence is None or fence.allows(LocalPlace(pose.north, pose.east))

    def allows_stage(
        self, goal: SingleGoal, progress: Progress, pose: Pose, origin: GlobalPlace | None
    ) -> bool:
        """Whether the way of a goal that begins, or goes on, here stays where it may be.

        From outside it may lead back in. What has no place to end at is watched while it drives.
        """
        fence = self.local(origin)
        end = _end_of(goal, progress)
        if fence is None or end is None:
            return True
        start = LocalPlace(pose.north, pose.east)
        if progress.path and progress.anchor is not None:
            left = rest_of(progress.path, progress.done)
            on_path = pose_on(progress.anchor, progress.path, progress.done)
            return is_allowed(on_path, left, fence)
        return fence.allows_way(start, end) or fence.escapes(start, end)

    def forbidden_leg(self, steps: Sequence[Step], origin: GlobalPlace | None) -> int | None:
        """Return a step that the straight way from the one before may not reach, or None.

        As far as places are known beforehand; the rest is looked at when it begins.
        """
        fence = self.local(origin)
        if fence is None:
            return None
        for number, step in enumerate(steps):
            start = _place_of(step, origin)
            for following in _next_places(steps, number) if start else ():
                end = _place_of(steps[following], origin)
                if start and end and not fence.allows_way(start, end):
                    return following
        return None

    def refuge(self, pose: Pose, origin: GlobalPlace | None) -> GlobalPlace | None:
        """Return the nearest rally point, None where there is none."""
        if origin is None or not self.rally:
            return None
        return min(self.rally, key=lambda place: distance(pose, to_local(place, origin)))


def _end_of(goal: SingleGoal, progress: Progress) -> LocalPlace | None:
    if isinstance(goal, GoTo):
        return progress.target
    anchor = progress.anchor
    if anchor is None or not isinstance(goal, Move | MoveTurned):
        return None
    way = goal.distance
    if isinstance(goal, MoveTurned) and progress.leg != WAY:
        way = -way if progress.leg < WAY else 0.0  # not turned round yet, or there
    return LocalPlace(anchor.north + way * cos(anchor.yaw), anchor.east + way * sin(anchor.yaw))


def _place_of(step: Step, origin: GlobalPlace | None) -> LocalPlace | None:
    return local_place(step.place, origin) if isinstance(step, GoTo) else None


def _next_places(steps: Sequence[Step], number: int) -> list[int]:
    """Return the steps whose places may be driven to next, by whichever jumps."""
    found: list[int] = []
    seen: set[int] = set()
    waiting = [number + 1]
    while waiting:
        step = waiting.pop()
        if step in seen or not 0 <= step < len(steps):
            continue
        seen.add(step)
        match steps[step]:
            case GoTo():
                found.append(step)
            case Move() | MoveTurned() | Drive() | Head():
                pass  # where that ends is not known
            case Jump(to=to):
                waiting += [step + 1, to]
            case _:
                waiting.append(step + 1)
    return found
