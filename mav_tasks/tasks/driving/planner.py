"""Ways for a vehicle that steers as a car: arcs of its turning circle, straights, and reversing.

To a place: turn towards it on one of the two circles, then drive straight. Where that is long, or
leaves the fence, it drives a piece forwards or backwards before, or both, as in a three-point
turn. To a pose: an arc, a straight and an arc (L. E. Dubins, On Curves of Minimal Length, 1957).
The shortest way that stays within the fence is taken.
"""

from cmath import phase, rect
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import atan2, hypot, pi, remainder, sqrt, tau

from mav_tasks.tasks.driving.fence import LocalFence
from mav_tasks.tasks.driving.legs import FACE, WAY
from mav_tasks.tasks.driving.path import (
    STRAIGHT,
    Path,
    joined,
    moved,
    path_length,
    places_on,
    runs_of,
    turn_of,
)
from mav_tasks.tasks.goal import LocalPlace
from mav_tasks.tasks.task import Bend, Pose, Progress

#: of the turning radius: what is planned leaves something to steer with
SPARE = 1.15
#: m between a bend and the fence, where there is room: ArduPilot's own steering with default gains
#: reached half the curvature asked for (4.6.3, SITL), so that a bend is driven wider
CLEARANCE = 0.3
#: m of way that a change of direction is worth, so that it turns forwards unless that is a loop: it
#: stands for some 3 s, and drives backwards where people do not expect it
CUSP = 4.0
BACKWARDS = 1.0  # of the way driven backwards, as much more it counts
#: of the radius, lengths of the piece before the turn
PIECES = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0)
THREE_POINT = (0.5, 0.9, 1.4)  # of the radius, the same for both pieces of a three-point turn
THERE = 0.1  # m from a place: ArduPilot's simulated car (4.6.3) is not more exact
HERE = 1e-3  # m and rad from a place or heading: there is no way to it


@dataclass(frozen=True, slots=True)
class Steering:
    """What ways of a vehicle that steers as a car are made of.

    ``radius`` is its least, m; ``reverses``: it can; ``fence``: where it may be, None = everywhere.
    """

    radius: float
    reverses: bool
    fence: LocalFence | None = None

    @property
    def planned_radius(self) -> float:
        """Return the radius of its bends, m."""
        return SPARE * self.radius


def way_to(pose: Pose, place: LocalPlace, steering: Steering) -> Path | None:
    """Return the whole way to a place, which may reverse; None: none stays within the fence."""
    if hypot(place.north - pose.north, place.east - pose.east) < HERE:
        return (Bend(0.0, HERE),)
    return _best(pose, _ways_to(pose, place, steering), steering.fence)


def boldest_way_to(pose: Pose, place: LocalPlace, steering: Steering) -> Path:
    """Return the way to a place that would be taken if there were no fence."""
    way = way_to(pose, place, Steering(steering.radius, steering.reverses))
    assert way is not None, "a place is never inside both turning circles"
    return way


def way_to_pose(pose: Pose, goal: Pose, steering: Steering) -> Path | None:
    """Return the way to a pose, in one direction; None: none stays within the fence."""
    if _is_at(pose, goal):
        return (Bend(0.0, HERE),)
    ways = list(_dubins(pose, goal, steering.planned_radius))
    if steering.reverses:
        mirrored = _dubins(_turned(pose), _turned(goal), steering.planned_radius)
        ways += [_reversed(way) for way in mirrored]
    return _best(pose, ways, steering.fence)


def set_out_to(progress: Progress, pose: Pose, place: LocalPlace, steering: Steering) -> Progress:
    """Return the progress with which the first run of the way to a place begins.

    Where no way stays within the fence it is the one that would be driven without. A place that is
    reached as exactly as a car does is not left so as to come nearer.
    """
    if hypot(place.north - pose.north, place.east - pose.east) <= THERE:
        return replace(progress, leg=WAY, anchor=pose, path=(Bend(0.0, HERE),), done=0.0)
    way = way_to(pose, place, steering) or boldest_way_to(pose, place, steering)
    first, *others = runs_of(way)
    return replace(progress, leg=FACE if others else WAY, anchor=pose, path=first, done=0.0)


def is_allowed(pose: Pose, path: Path, fence: LocalFence | None, *, clear: float = 0.0) -> bool:
    """Whether a way from a pose stays within a fence, or leads back in and stays there."""
    if fence is None:
        return True
    corners = [LocalPlace(p.north, p.east) for p in places_on(pose, path, outside=clear)]
    if fence.allows(LocalPlace(pose.north, pose.east)):
        return all(fence.allows_way(here, there) for here, there in pairwise(corners))
    states = [fence.allows(corner) for corner in corners]
    return states[-1] and states == sorted(states)


def _best(pose: Pose, ways: Iterable[Path], fence: LocalFence | None) -> Path | None:
    """Return the cheapest that is allowed, with room beside its bends if there is such a one."""
    cheapest = sorted((way for way in ways if way), key=_cost)
    if fence is None:
        return cheapest[0] if cheapest else None
    for clear in (CLEARANCE, 0.0):
        for way in cheapest:
            if is_allowed(pose, way, fence, clear=clear):
                return way
    return None


def _cost(way: Path) -> float:
    backwards = sum(-bend.length for bend in way if bend.length < 0)
    return path_length(way) + BACKWARDS * backwards + CUSP * (len(runs_of(way)) - 1)


def _ways_to(pose: Pose, place: LocalPlace, steering: Steering) -> Iterator[Path]:
    radius = steering.planned_radius
    for first in _beginnings(radius, reverses=steering.reverses):
        start = pose
        for bend in first:
            start = moved(start, bend.curvature, bend.length)
        for rest in _turns_to(start, place, radius):
            yield joined(first, rest)


def _beginnings(radius: float, *, reverses: bool) -> Iterator[Path]:
    """Yield what may be driven before the turn towards a place."""
    yield ()
    bends = (0.0, 1 / radius, -1 / radius)
    directions = (1.0, -1.0) if reverses else (1.0,)
    for curvature, share, ahead in product(bends, PIECES, directions):
        yield (Bend(curvature, ahead * share * radius),)
    if not reverses:
        return
    for curvature, there, back in product(bends[1:], THREE_POINT, THREE_POINT):
        yield Bend(curvature, there * radius), Bend(-curvature, -back * radius)


def _turns_to(pose: Pose, place: LocalPlace, radius: float) -> Iterator[Path]:
    """Yield an arc and a straight to a place, for each side on which there is such a way."""
    for side in (1.0, -1.0):
        centre = _point(pose) + side * radius * 1j * rect(1.0, pose.yaw)
        to_place = complex(place.north, place.east) - centre
        if abs(to_place) < radius:
            continue
        straight = sqrt(max(0.0, abs(to_place) ** 2 - radius * radius))
        yaw = phase(to_place) + atan2(side * radius, straight)
        turn = turn_of(pose.yaw, yaw, side)
        yield joined((Bend(side / radius, turn * radius),), (Bend(0.0, straight),))


def _dubins(pose: Pose, goal: Pose, radius: float) -> Iterator[Path]:
    """Yield an arc, a straight and an arc, for each pair of sides for which there is such a way."""
    for first, last in product((1.0, -1.0), repeat=2):
        start = _point(pose) + first * radius * 1j * rect(1.0, pose.yaw)
        end = _point(goal) + last * radius * 1j * rect(1.0, goal.yaw)
        between, across = end - start, (last - first) * radius
        if abs(between) < abs(across):
            continue
        straight = sqrt(abs(between) ** 2 - across * across)
        # two times the same circle has no direction of its own: straight from where it is
        yaw = phase(between) - atan2(across, straight) if abs(between) > STRAIGHT else pose.yaw
        arcs = (turn_of(pose.yaw, yaw, first), turn_of(yaw, goal.yaw, last))
        if first == last and sum(arcs) >= tau and straight < STRAIGHT:
            arcs = (arcs[0], arcs[1] - tau)
        yield joined(
            (Bend(first / radius, arcs[0] * radius), Bend(0.0, straight)),
            (Bend(last / radius, arcs[1] * radius),),
        )


def _is_at(pose: Pose, goal: Pose) -> bool:
    away = hypot(goal.north - pose.north, goal.east - pose.east)
    return away < HERE and abs(remainder(goal.yaw - pose.yaw, tau)) < HERE


def _turned(pose: Pose) -> Pose:
    return replace(pose, yaw=pose.yaw + pi)


def _reversed(way: Path) -> Path:
    """Return what is driven backwards where its mirror image is driven forwards."""
    return tuple(Bend(-bend.curvature, -bend.length) for bend in way)


def _point(pose: Pose) -> complex:
    return complex(pose.north, pose.east)
