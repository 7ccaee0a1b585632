"""Poses, and paths of bounded curvature: arcs and straights, one after another. Geometry only.

A path begins at a pose, its anchor, and a place on it is given in metres along it. Hence the
anchor, the pieces and one number say how far a vehicle has come. Within one path a vehicle drives
in one direction, forwards or backwards.
"""

from cmath import phase, rect
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from math import atan2, copysign, cos, hypot, pi, sin, tau

from mav_tasks.kinds.places import Bend, LocalPlace, Pose

Spot = LocalPlace | Pose
Path = tuple[Bend, ...]

#: m along a path, to either side of a vehicle's last place, in which it is searched: where a path
#: crosses itself, the nearest place may be one that is yet to come
WINDOW = 1.0
STRAIGHT = 1e-9  # 1/m; less curvature counts as straight


def wrap(angle: float) -> float:
    """Return an angle wrapped to ±pi."""
    return atan2(sin(angle), cos(angle))


def distance(here: Spot, there: Spot) -> float:
    """Return the metres from one place to another."""
    return hypot(there.north - here.north, there.east - here.east)


def point_of(place: Spot) -> complex:
    """Return a place as a number: metres north, and imaginary ones east."""
    return complex(place.north, place.east)


def bearing(pose: Pose, place: Spot) -> float:
    """Return the direction of a place, or the vehicle's heading if it is already there."""
    if distance(pose, place) < 1e-6:
        return pose.yaw
    return atan2(place.east - pose.east, place.north - pose.north)


def seen_from(start: Pose, pose: Pose) -> complex:
    """Return how many metres a pose is ahead of another, and as imaginary ones to its right."""
    return (point_of(pose) - point_of(start)) * rect(1.0, -start.yaw)


def forward_of(start: Pose, pose: Pose) -> float:
    """Return how many metres a pose is ahead of another, along the yaw of that."""
    return seen_from(start, pose).real


def cross_track(start: Pose, pose: Pose) -> float:
    """Return how many metres a pose is to the right of the line from another along its yaw."""
    return seen_from(start, pose).imag


def moved(pose: Pose, curvature: float, length: float) -> Pose:
    """Return the pose after ``length`` metres on a circle, or straight on; negative: backwards."""
    if abs(curvature) < STRAIGHT:
        yaw, way = pose.yaw, rect(length, pose.yaw)
    else:
        yaw = pose.yaw + curvature * length
        way = (rect(1.0, yaw) - rect(1.0, pose.yaw)) / (1j * curvature)
    return Pose(pose.north + way.real, pose.east + way.imag, yaw)


def path_length(path: Path) -> float:
    """Return the length of a path in metres."""
    return sum(abs(bend.length) for bend in path)


def pose_on(anchor: Pose, path: Path, along: float) -> Pose:
    """Return the pose ``along`` metres on a path; it extends straight before and beyond."""
    pose, ahead = anchor, direction_of(path)
    for bend in path if along > 0 else ():
        length = abs(bend.length)
        if along <= length:
            return moved(pose, bend.curvature, ahead * along)
        pose = moved(pose, bend.curvature, bend.length)
        along -= length
    return moved(pose, 0.0, ahead * along)


def curvature_at(path: Path, along: float) -> float:
    """Return the curvature at a place on a path in 1/m, clockwise positive; 0 outside."""
    for bend in path:
        if 0 <= along < abs(bend.length):
            return bend.curvature
        along -= abs(bend.length)
    return 0.0


def nearest(
    anchor: Pose, path: Path, pose: Pose, *, around: float, window: float = WINDOW
) -> float:
    """Return the place on a path that is nearest to a pose, within ``window`` of ``around``."""
    places = _candidates(anchor, path, pose, around=around)
    near = [along for along in places if abs(along - around) <= window]
    if not near:  # stay at the last one
        return min(max(around, 0.0), path_length(path))
    return min(near, key=lambda along: distance(pose_on(anchor, path, along), pose))


def beside(anchor: Pose, path: Path, pose: Pose, along: float) -> float:
    """Return how many metres a pose is to the right of a place on a path."""
    return cross_track(pose_on(anchor, path, along), pose)


def joined(first: Path, second: Path) -> Path:
    """Return two paths joined: empty pieces removed, equal neighbours merged."""
    pieces: list[Bend] = []
    for bend in (*first, *second):
        last = pieces[-1] if pieces else None
        if abs(bend.length) <= STRAIGHT:
            continue
        if last and last.curvature == bend.curvature and last.length * bend.length > 0:
            pieces[-1] = Bend(bend.curvature, last.length + bend.length)
        else:
            pieces.append(bend)
    return tuple(pieces)


def rest_of(path: Path, done: float) -> Path:
    """Return the rest of a path after ``done`` metres."""
    left: list[Bend] = []
    for bend in path:
        length = abs(bend.length)
        kept = length - max(0.0, min(done, length))
        left.append(Bend(bend.curvature, copysign(kept, bend.length)))
        done -= length
    return joined((), tuple(left))


def runs_of(path: Path) -> list[Path]:
    """Return the runs of a way, between which a vehicle changes its direction."""
    return [tuple(run) for _, run in groupby(path, lambda bend: bend.length < 0)]


def direction_of(path: Path) -> float:
    """Return -1.0 for a path that is driven backwards, otherwise 1.0."""
    return -1.0 if path and path[0].length < 0 else 1.0


def _candidates(anchor: Pose, path: Path, pose: Pose, *, around: float) -> Iterator[float]:
    """Yield the nearest place to a pose for each piece, and for both extensions."""
    start, begins, ahead = anchor, 0.0, direction_of(path)
    yield min(0.0, ahead * forward_of(anchor, pose))
    for bend in path:
        length = abs(bend.length)
        if abs(bend.curvature) < STRAIGHT:
            along = ahead * forward_of(start, pose)
        else:
            along = _on_circle(start, bend.curvature, ahead, pose, around=around - begins)
        yield begins + min(max(along, 0.0), length)
        start, begins = moved(start, bend.curvature, bend.length), begins + length
    yield begins + max(0.0, ahead * forward_of(start, pose))


def _on_circle(start: Pose, curvature: float, ahead: float, pose: Pose, *, around: float) -> float:
    """Return how far along a circle a pose is, in the turn that is nearest to ``around``."""
    centre = point_of(start) + 1j * rect(1.0, start.yaw) / curvature
    yaw = phase(1j * curvature * (point_of(pose) - centre))
    round_once = tau / abs(curvature)
    along = ahead * (yaw - start.yaw) / curvature
    return along + round_once * round((around - along) / round_once)


def turn_of(yaw: float, to: float, side: float) -> float:
    """Return the angle from one heading to another on that side (1 clockwise), 0 to 2 pi."""
    turn = (side * (to - yaw)) % tau
    return 0.0 if tau - turn < 1e-9 else turn


#: rad; arcs up to this are treated as chords, which at a radius of 2 m are off by 1 cm
CHORD = pi / 15
ONCE_ROUND = 31  # arcs; what follows on a circle is there already


def places_on(anchor: Pose, path: Path, *, outside: float = 0.0) -> Iterator[Pose]:
    """Yield the corners of a way along a path, moved ``outside`` m outwards in its bends.

    Their yaw is to the right of the way.
    """
    start = anchor
    for bend in path:
        parts = 1 + int(abs(bend.curvature * bend.length) / CHORD)
        out = 0.0 if abs(bend.curvature) < STRAIGHT else -outside if bend.curvature > 0 else outside
        for part in range(min(parts, ONCE_ROUND) + 1):
            pose = moved(start, bend.curvature, bend.length * part / parts)
            yield moved(replace(pose, yaw=pose.yaw + pi / 2), 0.0, out)
        start = moved(start, bend.curvature, bend.length)
