"""Follow: drive along a path. It is a leg of the way to a place, and not a task of its own."""

from dataclasses import dataclass, replace
from math import atan2, copysign, inf, sqrt
from typing import ClassVar

from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import OFF_TRACK, TURNED, Leg, Took, Unit, is_turned, ramped
from mav_tasks.kinds.guidance import (
    MAX_APPROACH_ANGLE,
    MORE_CURVATURE,
    Situation,
    Velocity,
    approach,
    bend_speed,
    clamped,
)
from mav_tasks.kinds.path import (
    Path,
    beside,
    cross_track,
    curvature_at,
    direction_of,
    distance,
    nearest,
    path_length,
    pose_on,
    wrap,
)
from mav_tasks.kinds.places import Pose

#: m/s, limit for a bend that ends just before the path does. With 0.15 s of delay, 30 % overspeed
#: and half the commanded curvature, a place is then reached within 6 cm (p95), otherwise 13 cm
SLOW_BEND = 0.35
SETTLING = 2.5  # s until a vehicle is back on its path after a bend: five times REACH_TIME
PREVIEW = 0.2  # s until the wheels point as commanded
LEAST_REACH = 0.25  # m in which a heading error is corrected
REACH_TIME = 0.5  # s, the same for a fast vehicle, which reacts 0.2 s late
SLOWEST = 0.1  # m/s; a measured speed below it is too vague to compute a turn rate
#: m ahead on the path, the aim of a vehicle that is steered by course; metre-class GPS is off by
#: 0.2 m from one moment to the next
LOOKAHEAD = 1.0
LOOKAHEAD_TIME = 1.0  # s, the same for a fast vehicle
BESIDE_PATH = 0.5  # m off a car's path; steering could not correct much more


@dataclass(frozen=True, slots=True)
class Follow(Leg):
    """Drive along a path; ``speed`` in m/s, None = default."""

    unit: ClassVar[Unit] = Unit.METRES
    path: Path
    speed: float | None = None

    @property
    def length(self) -> float:
        return path_length(self.path)

    def at_speed(self, speed: float) -> "Follow":
        return replace(self, speed=speed)

    def done_so_far(
        self,
        anchor: Pose,
        pose: Pose,
        *,
        before: float,
        elapsed: float = 0.0,  # noqa: ARG002
    ) -> float:
        return nearest(anchor, self.path, pose, around=before)

    def steer(self, now: Situation) -> Velocity:
        driving, motion = now.driving, now.motion
        assert now.radius is not None, "a path is driven with a turning circle"
        # a vehicle that is steered by course is less exact, and may not move at all at low speed:
        # PX4's simulated one does not at 0.5 m/s (1.17, factory gains)
        settles = now.settles and now.passing == 0.0 and not now.by_course
        bends = _speed_in_bends(self.path, now.along, driving, settles=settles)
        towards_end = approach(
            now.remaining,
            top=min(self.speed or driving.speed, bends),
            braking=driving.acceleration,
            gain=now.slowest.gain,
            creep=now.slowest.speed,
            at_end=now.passing,
        )
        if now.by_course:
            look = max(LOOKAHEAD, LOOKAHEAD_TIME * motion.speed)
            there, here = pose_on(now.anchor, self.path, now.along + look), motion.pose
            return Velocity(
                towards_end, 0.0, atan2(there.east - here.east, there.north - here.north)
            )
        forward = copysign(towards_end, direction_of(self.path) * now.remaining)
        most = MORE_CURVATURE / now.radius
        curvature = clamped(_curvature(self.path, now, forward), most)
        rolling = min(max(abs(motion.forward), min(towards_end, SLOWEST)), 2 * towards_end)
        turn = curvature * copysign(rolling, forward)
        return Velocity(forward, clamped(turn, driving.max_turn_rate))

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:
        return Took(ramped(left, self.speed or speed, driving.acceleration), left, anchor)

    def beside(self, anchor: Pose, pose: Pose, done: float) -> float:
        return abs(beside(anchor, self.path, pose, done))

    def is_left(self, anchor: Pose, pose: Pose, done: float) -> bool:
        along = nearest(anchor, self.path, pose, around=done, window=inf)
        return distance(pose, pose_on(anchor, self.path, along)) > OFF_TRACK

    def goes_on_from(self, anchor: Pose, pose: Pose, done: float, *, is_car: bool) -> bool:
        """Steering can return to a path by itself, near where it was left."""
        there = pose_on(anchor, self.path, nearest(anchor, self.path, pose, around=done))
        is_near = distance(pose, there) <= BESIDE_PATH and not is_turned(pose, there, TURNED)
        return is_car and is_near


def _speed_in_bends(path: Path, along: float, driving: Driving, *, settles: bool) -> float:
    """Return the highest speed that still lets it slow down for every bend ahead.

    ``settles``: it leaves the last bend slowly enough to be back on its path at the end.
    """
    fastest, begins = inf, 0.0
    left = path_length(path)
    for bend in path:
        ends = begins + abs(bend.length)
        left -= abs(bend.length)
        if ends >= along:
            there = bend_speed(bend.curvature, driving)
            if there < inf and settles:
                there = min(there, max(SLOW_BEND, left / SETTLING))
            room = max(0.0, begins - along)
            fastest = min(fastest, sqrt(there * there + driving.acceleration * room))
        begins = ends
    return fastest


def _curvature(path: Path, now: Situation, forward: float) -> float:
    """Return the path's curvature, corrected for heading error and cross-track error.

    Cross-track error e and heading error h change, for each metre, by d*h and d*(k - path's k),
    with d 1 forwards and -1 backwards. With reach r, k - path's k = -(h + d*e/2r) * d/r damps both.
    """
    motion, along, d = now.motion, now.along, copysign(1.0, forward)
    reach = max(LEAST_REACH, REACH_TIME * motion.speed)
    on_path = min(max(along, 0.0), path_length(path))
    there = pose_on(now.anchor, path, along)
    error = wrap(motion.pose.yaw - there.yaw)
    back = clamped(cross_track(there, motion.pose) / (2 * reach), MAX_APPROACH_ANGLE)
    soon = min(on_path + PREVIEW * motion.speed, path_length(path))
    return curvature_at(path, soon) - d * (error + d * back) / reach
