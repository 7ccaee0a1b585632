"""Detects a vehicle that does not go where it is told, from its own measurements.

A closed loop on a wrong heading, or on wheels that turn the wrong way, drives away from its end
ever faster. There are two signs: the vehicle moves in another direction than it points, or it
drives off its line.
"""

from math import copysign, cos, hypot, radians, sin

from mav_tasks.tasks.driving.guidance import Motion, Velocity, cross_track, wrap
from mav_tasks.tasks.driving.legs import distance
from mav_tasks.tasks.driving.path import Follow, beside
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.driving.recovery_path import OFF_TRACK
from mav_tasks.tasks.goal import Move
from mav_tasks.tasks.task import Pose

WRONG_WAY = 0.5  # m driven in another direction than it points, or reverses, in
#: m, the same for a car that is steered by course: while it stood, its estimate went 0.6 m to the
#: side for seconds (PX4 1.17 with metre-class GPS)
WRONG_WAY_OF_ONE_TRY = 1.5
WENT = 0.5  # of that; if its position has moved less, its reported speed was no motion
MOVES = 0.05  # m/s; the direction of a slower motion means nothing
ALONG = 0.5  # cosine of 60 degrees: least part of its speed in the direction that it points in
TURNS = radians(15)  # rad off the commanded course: it is still turning there
CORRECTED = 0.1  # m beyond what it drove between two looks: its estimate was corrected


class AstrayWatch:
    """Divergence detector of one vehicle for one task."""

    def __init__(self) -> None:
        self._asked = 0.0  # m/s forward, the last non-zero setpoint
        self._is_asked = False  # now; otherwise it is only to turn or to stand
        self._course: float | None = None
        self._rolls_on = False  # from before the direction was reversed
        self._wrong = 0.0  # m, since it last went where it pointed
        self._wrong_from = Pose(0.0, 0.0, 0.0)  # where that began
        self._last: Motion | None = None
        self._beside = 0.0  # m from its line, at the last look
        self._least: float | None = None  # least m from its line on this leg

    def begin_leg(self) -> None:
        """Note that another line begins; wrong-way motion before it still counts."""
        self._least = None

    def commanded(self, velocity: Velocity) -> None:
        """Note the velocity that is commanded now."""
        self._course = velocity.course
        self._is_asked = velocity.forward != 0.0
        if not self._is_asked:
            return
        if velocity.forward * self._asked < 0.0:
            self._rolls_on = True
        self._asked = velocity.forward

    def is_astray(self, course: PathFollower, motion: Motion) -> bool:
        """Return whether the vehicle's motion contradicts its setpoints; call with each motion."""
        last = self._last
        if motion is last:
            return False
        self._last = motion
        elapsed = 0.0 if last is None else max(0.0, motion.at - last.at)
        most = WRONG_WAY_OF_ONE_TRY if course.has_one_try else WRONG_WAY
        goes_wrong = self._goes_wrong(motion, most=most, elapsed=elapsed)
        return self._has_left(course, motion, last, elapsed=elapsed) or goes_wrong

    def _goes_wrong(self, motion: Motion, *, most: float, elapsed: float) -> bool:
        speed = motion.speed
        if speed < MOVES:
            self._rolls_on = False
        elif not self._is_asked:
            pass  # it may roll on, or drift while it turns on the spot
        elif copysign(1.0, self._asked) * motion.forward >= ALONG * speed:
            self._rolls_on, self._wrong = False, 0.0
        elif not self._rolls_on:
            if self._wrong == 0.0:
                self._wrong_from = motion.pose
            self._wrong += speed * elapsed
        if self._wrong > most and not self._got_there(motion, most=most):
            self._wrong = 0.0
        return self._wrong > most

    def _got_there(self, motion: Motion, *, most: float) -> bool:
        """Return whether its position has gone the wrong way, too.

        Reported speeds alone add up to metres for a rover that stands or crawls: with metre-class
        GPS they are off by 0.3 m/s for minutes (PX4 1.17).
        """
        started, here = self._wrong_from, motion.pose
        north, east = here.north - started.north, here.east - started.east
        way = hypot(north, east)
        along = copysign(1.0, self._asked) * (north * cos(here.yaw) + east * sin(here.yaw))
        return way > WENT * most and along < ALONG * way

    def _has_left(
        self, course: PathFollower, motion: Motion, last: Motion | None, *, elapsed: float
    ) -> bool:
        """Return whether it has driven off its line; a corrected position does not count."""
        anchor = course.progress.anchor
        leg = course.leg
        if anchor is None or not isinstance(leg, Move | Follow):
            self._least = None
            return False
        before = self._beside
        if isinstance(leg, Follow):
            self._beside = abs(beside(anchor, leg.path, motion.pose, course.progress.done))
        else:
            self._beside = abs(cross_track(anchor, motion.pose))
        if self._least is None or last is None or self._is_turning(motion):
            self._least = self._beside
        elif distance(last.pose, motion.pose) > CORRECTED + 2 * motion.speed * elapsed:
            self._least += self._beside - before
        self._least = min(self._least, self._beside)
        return self._beside - self._least > OFF_TRACK

    def _is_turning(self, motion: Motion) -> bool:
        return self._course is not None and abs(wrap(self._course - motion.pose.yaw)) > TURNS
