"""Where one vehicle may drive, and which rally point it returns to."""

from collections.abc import Sequence

from mav_tasks.tasks.driving.fence import Fence, LocalFence
from mav_tasks.tasks.driving.legs import WAY
from mav_tasks.tasks.driving.mission_sequencer import ways_on
from mav_tasks.tasks.driving.path import Spot, distance, moved, pose_on, rest_of
from mav_tasks.tasks.driving.planner import is_allowed
from mav_tasks.tasks.frames import local_place, to_local
from mav_tasks.tasks.goal import (
    Drive,
    GlobalPlace,
    GoTo,
    Head,
    Move,
    MoveTurned,
    SingleGoal,
    Step,
)
from mav_tasks.tasks.task import Pose, Progress


class Bounds:
    """The fence and rally points of one vehicle; ``origin`` is that of its local frame."""

    def __init__(self) -> None:
        self.fence = Fence()
        self.rally: tuple[GlobalPlace, ...] = ()
        self._local: LocalFence | None = None
        self._made_of: tuple[Fence, GlobalPlace] | None = None

    def __repr__(self) -> str:
        return f"Bounds({len(self.fence.zones)} zones, {len(self.rally)} rally points)"

    def is_unknown(self, origin: GlobalPlace | None) -> bool:
        """Return whether there is a fence whose place in the vehicle's frame is unknown."""
        return bool(self.fence.zones) and origin is None

    def local(self, origin: GlobalPlace | None) -> LocalFence | None:
        """Return the fence in the frame of an origin; None without a fence or an origin."""
        if origin is None or not self.fence.zones:
            return None
        if self._made_of != (self.fence, origin):
            self._local, self._made_of = LocalFence(self.fence, origin), (self.fence, origin)
        return self._local

    def allows(self, pose: Pose, origin: GlobalPlace | None) -> bool:
        """Return whether the vehicle may be at a pose."""
        fence = self.local(origin)
        return fence is None or fence.allows(pose)

    def metres_to_leave(
        self, goal: SingleGoal, progress: Progress, pose: Pose, origin: GlobalPlace | None
    ) -> float | None:
        """Return after how many metres the way of a goal that starts or resumes here leaves the
        fence; None: it stays inside, 0.0: at once, or somewhere in its bends.

        From outside, the way may lead back in. A goal without a place to end at is allowed, and
        watched while it drives.
        """
        fence, end = self.local(origin), _end_of(goal, progress)
        if fence is None or end is None:
            return None
        if progress.path and progress.anchor is not None:
            left = rest_of(progress.path, progress.done)
            there = pose_on(progress.anchor, progress.path, progress.done)
            return None if is_allowed(there, left, fence) else 0.0
        return None if fence.escapes(pose, end) else fence.first_forbidden(pose, end)

    def forbidden_leg(self, steps: Sequence[Step], origin: GlobalPlace | None) -> int | None:
        """Return a step to which the straight way from the place before crosses the fence, or None.

        It checks the places that are known beforehand; others are checked when their step begins.
        """
        fence = self.local(origin)
        if fence is None:
            return None
        places = [
            local_place(step.place, origin) if isinstance(step, GoTo) else None for step in steps
        ]
        for number, start in enumerate(places):
            for following in _next_places(steps, number) if start else ():
                end = places[following]
                if start and end and not fence.allows_way(start, end):
                    return following
        return None

    def refuge(self, pose: Pose, origin: GlobalPlace | None) -> GlobalPlace | None:
        """Return the nearest rally point, or None."""
        if origin is None or not self.rally:
            return None
        return min(self.rally, key=lambda place: distance(pose, to_local(place, origin)))


def _end_of(goal: SingleGoal, progress: Progress) -> Spot | None:
    if isinstance(goal, GoTo):
        return progress.target
    anchor = progress.anchor
    if anchor is None or not isinstance(goal, Move | MoveTurned):
        return None
    way = goal.distance
    if isinstance(goal, MoveTurned) and progress.leg != WAY:
        way = -way if progress.leg < WAY else 0.0  # it has not turned round yet, or is there
    return moved(anchor, 0.0, way)


def _next_places(steps: Sequence[Step], number: int) -> list[int]:
    """Return the steps whose places may come next, whichever jumps are taken."""
    found: list[int] = []
    seen: set[int] = set()
    waiting = [number + 1]
    while waiting:
        step = waiting.pop()
        if step in seen or not 0 <= step < len(steps):
            continue
        seen.add(step)
        if isinstance(steps[step], GoTo):
            found.append(step)
        elif not isinstance(steps[step], Move | MoveTurned | Drive | Head):  # its end is not known
            waiting += ways_on(steps, step)
    return found
