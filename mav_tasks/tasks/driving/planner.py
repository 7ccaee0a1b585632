"""Plans ways for a car: arcs of its turning circle, straights, and reversing.

To a place: an arc towards it on one of the two turning circles, then a straight. If that is long or
leaves the fence, the car first drives a piece forwards or backwards, or both, as in a three-point
turn. To a pose: an arc, a straight and an arc (L. E. Dubins, On Curves of Minimal Length, 1957).
The cheapest way that stays within the fence is taken.
"""

from cmath import phase, rect
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import atan2, copysign, pi, remainder, sqrt, tau

from mav_tasks.kinds import Bend, GoTo, LocalPlace, Pose
from mav_tasks.kinds.base import FACE, WAY
from mav_tasks.kinds.path import (
    STRAIGHT,
    Path,
    bearing,
    distance,
    joined,
    moved,
    path_length,
    places_on,
    point_of,
    runs_of,
    turn_of,
)
from mav_tasks.tasks.driving.fence import LocalFence
from mav_tasks.tasks.task import Progress

#: factor on the turning radius: a planned bend leaves room to steer
SPARE = 1.15
#: m between a bend and the fence, if there is room: ArduPilot's own steering with default gains
#: reached half the curvature commanded (4.6.3, SITL), so that a bend is driven wider
CLEARANCE = 0.3
#: m of way that a change of direction costs, so that a car turns forwards unless that is a loop: it
#: stands for some 3 s, and drives backwards, which people do not expect
CUSP = 4.0
BACKWARDS = 1.0  # extra cost of a way driven backwards, as a factor
#: lengths of the piece before the turn, as factors on the radius
PIECES = (0.3, 0.6, 1.0, 1.5, 2.2, 3.0)
THREE_POINT = (0.5, 0.9, 1.4)  # the same for both pieces of a three-point turn
THERE = 0.1  # m; nearer is at the place: ArduPilot's simulated car (4.6.3) is no more exact
ENTRIES = 12  # places of a circle at which it may be entered
HERE = 1e-3  # m and rad from a place or heading; nearer needs no way


@dataclass(frozen=True, slots=True)
class Steering:
    """Constraints on the ways of a car.

    ``radius`` is its minimum turning radius, m; ``reverses``: it can; ``fence``: None = no fence.
    """

    radius: float
    reverses: bool
    fence: LocalFence | None = None

    @property
    def planned_radius(self) -> float:
        """Radius of planned bends, m."""
        return SPARE * self.radius


def way_to(pose: Pose, place: LocalPlace, steering: Steering) -> Path | None:
    """Return the whole way to a place, which may reverse; None if none stays within the fence."""
    if distance(pose, place) < HERE:
        return (Bend(0.0, HERE),)
    return _best(pose, _ways_to(pose, place, steering), steering.fence)


def way_to_pose(pose: Pose, goal: Pose, steering: Steering) -> Path | None:
    """Return the way to a pose, in one direction; None if none stays within the fence."""
    if distance(pose, goal) < HERE and abs(remainder(goal.yaw - pose.yaw, tau)) < HERE:
        return (Bend(0.0, HERE),)
    ways = list(_dubins(pose, goal, steering.planned_radius))
    if steering.reverses:
        mirrored = _dubins(_turned(pose), _turned(goal), steering.planned_radius)
        ways += map(_reversed, mirrored)
    return _best(pose, ways, steering.fence)


def way_round(
    goal: GoTo, progress: Progress, pose: Pose, centre: LocalPlace, steering: Steering
) -> Path:
    """Return the way onto a circle and round it, forwards, no narrower than can be driven."""
    side, radius = copysign(1.0, goal.around), max(abs(goal.around), steering.planned_radius)
    left = tau * goal.turns
    if path := progress.path:  # it has driven part of it
        metres = min(path[-1].length, path_length(path) - progress.done)
        left = max(0.0, metres * abs(path[-1].curvature))
    arc = Bend(side / radius, left * radius)
    anyhow = replace(steering, reverses=False, fence=None)
    outwards, ways = bearing(pose, centre) + pi, list[Path]()
    for number in range(ENTRIES):
        out = outwards + tau * number / ENTRIES
        place = moved(Pose(centre.north, centre.east, out), 0.0, radius)
        way = way_to_pose(pose, replace(place, yaw=out + side * pi / 2), anyhow)
        ways.append((*(way or ()), arc))
    return _best(pose, ways, steering.fence) or _best(pose, ways, None) or (arc,)


def set_out_to(
    goal: GoTo, progress: Progress, pose: Pose, place: LocalPlace, steering: Steering
) -> Progress:
    """Return the progress with which the first run of the way to a place begins.

    If no way stays within the fence, it ignores the fence. A car that is as near to the
    place as it can get stays there.
    """
    here = replace(progress, leg=WAY, anchor=pose, done=0.0)
    if goal.turns:
        return replace(here, path=way_round(goal, progress, pose, place, steering))
    if distance(pose, place) <= THERE:
        return replace(here, path=(Bend(0.0, HERE),))
    start = _turned(pose) if goal.backwards else pose
    anyhow = replace(steering, fence=None)
    way = way_to(start, place, steering) or way_to(start, place, anyhow) or ()
    first, *others = runs_of(_reversed(way) if goal.backwards else way)
    return replace(here, leg=FACE if others else WAY, path=first)


def is_allowed(pose: Pose, path: Path, fence: LocalFence | None, *, clear: float = 0.0) -> bool:
    """Return whether a way from a pose stays within a fence, or leads back in and stays there."""
    if fence is None:
        return True
    corners = list(places_on(pose, path, outside=clear))
    if fence.allows(pose):
        return all(fence.allows_way(here, there) for here, there in pairwise(corners))
    states = [fence.allows(corner) for corner in corners]
    return states[-1] and states == sorted(states)


def _best(pose: Pose, ways: Iterable[Path], fence: LocalFence | None) -> Path | None:
    """Return the cheapest allowed way, if possible one with room beside its bends; None if none."""
    cheapest = sorted((way for way in ways if way), key=_cost)
    if fence is None:
        return next(iter(cheapest), None)
    all_ways = product((CLEARANCE, 0.0), cheapest)
    return next((way for clear, way in all_ways if is_allowed(pose, way, fence, clear=clear)), None)


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
    """Yield the pieces that may come before the turn towards a place."""
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
    """Yield an arc and a straight to a place, for each side that has such a way."""
    for side in (1.0, -1.0):
        centre = point_of(pose) + side * radius * 1j * rect(1.0, pose.yaw)
        to_place = complex(place.north, place.east) - centre
        if abs(to_place) < radius:
            continue
        straight = sqrt(max(0.0, abs(to_place) ** 2 - radius * radius))
        yaw = phase(to_place) + atan2(side * radius, straight)
        turn = turn_of(pose.yaw, yaw, side)
        yield joined((Bend(side / radius, turn * radius),), (Bend(0.0, straight),))


def _dubins(pose: Pose, goal: Pose, radius: float) -> Iterator[Path]:
    """Yield an arc, a straight and an arc, for each pair of sides that has such a way."""
    for first, last in product((1.0, -1.0), repeat=2):
        start = point_of(pose) + first * radius * 1j * rect(1.0, pose.yaw)
        end = point_of(goal) + last * radius * 1j * rect(1.0, goal.yaw)
        between, across = end - start, (last - first) * radius
        if abs(between) < abs(across):
            continue
        straight = sqrt(abs(between) ** 2 - across * across)
        # coincident circles define no direction: keep the heading
        yaw = phase(between) - atan2(across, straight) if abs(between) > STRAIGHT else pose.yaw
        arcs = (turn_of(pose.yaw, yaw, first), turn_of(yaw, goal.yaw, last))
        if first == last and sum(arcs) >= tau and straight < STRAIGHT:
            arcs = (arcs[0], arcs[1] - tau)
        yield joined(
            (Bend(first / radius, arcs[0] * radius), Bend(0.0, straight)),
            (Bend(last / radius, arcs[1] * radius),),
        )


def _turned(pose: Pose) -> Pose:
    return replace(pose, yaw=pose.yaw + pi)


def _reversed(way: Path) -> Path:
    """Return a way in reverse, given the way forwards between the poses turned by pi."""
    return tuple(Bend(-bend.curvature, -bend.length) for bend in way)
