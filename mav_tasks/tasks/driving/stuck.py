"""Detects a vehicle that does not move when told to, by time or by the distance commanded.

There are two signs: no progress towards the end of the leg or, if the leg has no place to come
nearer to, standstill while a velocity is commanded.
"""

from math import inf, pi, radians

from mav_tasks.tasks.driving.guidance import Motion, Velocity, is_far_off, wrap
from mav_tasks.tasks.driving.legs import distance
from mav_tasks.tasks.driving.path import Follow
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.goal import Move, Rotate
from mav_tasks.tasks.task import Pose
from mav_tasks.tasks.view import VehicleView

PROGRESS = 0.02  # m or rad, less than this in the stuck time is no progress
FULL_TURNS = 2 * pi  # rad, at most, that it turns by itself towards its course; more is a circle
TURNED = radians(5)  # rad; more is a turn on the spot or in an arc, so it does follow
LIVES = 1e-6  # m between two looks; more shows that the estimate is not frozen
SLOW = 0.3  # of the distance commanded; more is motion
BLIND = 1.0  # m or rad commanded without progress or motion: stuck before the time is up


SAID_AFTER = 1.5  # s of commands without motion before the warning; the slowest rover took 0.6
LEAST_ASKED = 0.1  # m/s; slower is the approach to an end
LEAST_PART = 0.1  # of the distance commanded; less is standing


class Follows:
    """Early warning that a vehicle does not follow, long before it counts as stuck."""

    def __init__(self) -> None:
        self._since: float | None = None
        self._from = Pose(0.0, 0.0, 0.0)
        self._way = 0.0  # m commanded since then
        self._is_said = False

    def begin(self) -> None:
        """Reset for another leg."""
        self._since, self._is_said = None, False

    def look(self, velocity: Velocity, motion: Motion, *, seconds: float, now: float) -> str:
        """Return a warning that the vehicle does not move, once for each leg; "" otherwise."""
        speed = abs(velocity.forward)
        if speed < LEAST_ASKED:
            self._since = None
            return ""
        if self._since is None:
            self._since, self._from, self._way = now, motion.pose, 0.0
        self._way += speed * seconds
        here, there = motion.pose, self._from
        has_turned = abs(wrap(here.yaw - there.yaw)) > TURNED
        if distance(here, there) > LEAST_PART * self._way or has_turned:
            self._since = now if now - self._since > SAID_AFTER else self._since
            return ""
        if self._is_said or now - self._since < SAID_AFTER:
            return ""
        self._is_said = True
        return f"does not move (told {speed:.1f} m/s): check brake, speed gains, minimum speed"


class StuckWatch:
    """Detector of a stuck vehicle."""

    def __init__(self) -> None:
        self._best_remaining = inf
        self._progress_at = 0.0
        self._commanded = 0.0  # m or rad, since the last progress
        self._last = (0.0, 0.0)
        self._course: float | None = None  # the commanded course, if there is one
        self._turned = 0.0  # rad turned by itself since the last progress
        self._yaw: float | None = None  # at the last update of that
        self._pose: Pose | None = None  # at the last look

    def begin(self, *, now: float) -> None:
        """Reset: another leg begins, or nothing has been commanded yet."""
        self._best_remaining = inf
        self._progress_at = now
        self._commanded = 0.0
        self._last = (0.0, 0.0)
        self._turned, self._yaw = 0.0, None

    def commanded(self, velocity: Velocity, *, seconds: float) -> None:
        """Note the velocity that is commanded for the next ``seconds``."""
        self._last = (abs(velocity.forward) * seconds, abs(velocity.yaw_rate) * seconds)
        self._course = velocity.course

    def is_stuck(
        self, course: PathFollower, seen: VehicleView, *, limit: float, now: float
    ) -> bool:
        """Return whether it made no progress for ``limit`` seconds, or over BLIND commanded."""
        leg = course.leg
        forward, turned = self._last
        lives = self._lives(seen, has_one_try=course.has_one_try)
        if self._turns_by_itself(seen) and not seen.still and self._turned < FULL_TURNS:
            self._progressed(now)
        if isinstance(leg, Move | Rotate | Follow):
            if not lives:
                self._commanded += turned if isinstance(leg, Rotate) else forward
            left = abs(course.remaining)
            if left < self._best_remaining - PROGRESS:
                self._best_remaining = left
                self._turned = 0.0
                self._progressed(now)
        elif not seen.still or not (forward or turned):
            self._progressed(now)
        elif not lives:
            self._commanded += max(forward, turned)
        return now - self._progress_at > limit or self._commanded > BLIND

    def _lives(self, seen: VehicleView, *, has_one_try: bool) -> bool:
        """Return whether the estimate keeps changing although the rover hardly moves.

        A rover that stands for seconds before its speed loop overcomes friction (PX4) is only slow.
        If its estimate is frozen, nobody knows what it does, and it soon counts as stuck. The
        estimate of a car that is steered by course may drift anywhere; it still counts.
        """
        before, self._pose = self._pose, None if seen.motion is None else seen.motion.pose
        if before is None or self._pose is None:
            return False
        moved = distance(self._pose, before)
        return moved > LIVES and (has_one_try or moved < SLOW * self._last[0])

    def _turns_by_itself(self, seen: VehicleView) -> bool:
        """Return whether it is still far off its commanded course; count how far it turned."""
        if self._course is None or seen.motion is None:
            return False
        yaw = seen.motion.pose.yaw
        self._turned += abs(wrap(yaw - (yaw if self._yaw is None else self._yaw)))
        self._yaw = yaw
        return is_far_off(wrap(self._course - seen.motion.pose.yaw))

    def _progressed(self, now: float) -> None:
        self._progress_at = now
        self._commanded = 0.0
