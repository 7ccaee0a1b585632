"""Watches of one vehicle: it stands although told to move, goes astray, or its pose jumps.

A closed loop on a wrong heading, or on wheels that turn the wrong way, drives away from its end
ever faster. So a vehicle must come nearer to its end, move where it points, and stay on its line,
by its own measurements.
"""

from dataclasses import replace
from math import copysign, inf, pi, radians

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Pose, Unit
from mav_tasks.kinds.base import OFF_TRACK
from mav_tasks.kinds.guidance import Motion, Velocity, is_far_off
from mav_tasks.kinds.path import distance, forward_of, wrap
from mav_tasks.tasks.driving.path_follower import PathFollower
from mav_tasks.tasks.view import VehicleView

SAID_AFTER = 1.5  # s of commands without motion before the warning; the slowest rover took 0.6
LEAST_ASKED = 0.1  # m/s; slower is the approach to an end
LEAST_PART = 0.1  # of the distance commanded; less is standing

PROGRESS = 0.02  # m or rad, less than this in the stuck time is no progress
FULL_TURNS = 2 * pi  # rad, at most, that it turns by itself towards its course; more is a circle
TURNED = radians(5)  # rad; more is a turn on the spot or in an arc, so it does follow
LIVES = 1e-6  # m between two looks; more shows that the estimate is not frozen
SLOW = 0.3  # of the distance commanded; more is motion
BLIND = 1.0  # m or rad commanded without progress or motion: stuck before the time is up

WRONG_WAY = 0.5  # m driven in another direction than it points, or reverses, in
#: m, the same for a car that is steered by course: while it stood, its estimate went 0.6 m to the
#: side for seconds (PX4 1.17 with metre-class GPS)
WRONG_WAY_OF_ONE_TRY = 1.5
WENT = 0.5  # of that; if its position has moved less, its reported speed was no motion
MOVES = 0.05  # m/s; the direction of a slower motion means nothing
ALONG = 0.5  # cosine of 60 degrees: least part of its speed in the direction that it points in
TURNS = radians(15)  # rad off the commanded course: it is still turning there
CORRECTED = 0.1  # m beyond what it drove between two looks: its estimate was corrected

JUMP = 2.0  # m beyond the distance that the vehicle can have driven meanwhile
TURN = radians(45)  # rad, the same for the heading


class Follows:
    """Early warning that a vehicle does not follow, long before it counts as stuck."""

    def __init__(self) -> None:
        #: since when it has not followed, where it was then, and the metres commanded from there
        self._waits: tuple[float, Pose, float] | None = None
        self._is_said = False

    def begin(self) -> None:
        """Reset for another leg."""
        self._waits, self._is_said = None, False

    def look(self, velocity: Velocity, motion: Motion, *, seconds: float, now: float) -> str:
        """Return a warning that the vehicle does not move, once for each leg; "" otherwise."""
        speed, here = abs(velocity.forward), motion.pose
        if speed < LEAST_ASKED:
            self._waits = None
            return ""
        since, there, way = self._waits or (now, here, 0.0)
        way += speed * seconds
        is_long, has_turned = now - since >= SAID_AFTER, abs(wrap(here.yaw - there.yaw)) > TURNED
        follows = has_turned or distance(here, there) > LEAST_PART * way
        self._waits = now if follows and now - since > SAID_AFTER else since, there, way
        if follows or self._is_said or not is_long:
            return ""
        self._is_said = True
        return f"does not move (told {speed:.1f} m/s): check brake, speed gains, minimum speed"


class StuckWatch:
    """Detector of a vehicle that does not move when told to, by time or by distance commanded.

    There are two signs: no progress towards the end of the leg or, if the leg has no place to come
    nearer to, standstill while a velocity is commanded.
    """

    def __init__(self) -> None:
        self._course: float | None = None  # the commanded course, if there is one
        self._pose: Pose | None = None  # at the last look
        self.begin(now=0.0)

    def begin(self, *, now: float) -> None:
        """Reset: another leg begins, or nothing has been commanded yet."""
        self._best_remaining = inf
        self._progress_at = now
        self._commanded = 0.0  # m or rad, since the last progress
        self._last = (0.0, 0.0)  # m and rad, commanded until the next look
        self._turned = 0.0  # rad turned by itself since the last progress
        self._yaw: float | None = None  # at the last update of that

    def commanded(self, velocity: Velocity, *, seconds: float) -> None:
        """Note the velocity that is commanded for the next ``seconds``."""
        self._last = (abs(velocity.forward) * seconds, abs(velocity.yaw_rate) * seconds)
        self._course = velocity.course

    def is_stuck(
        self, course: PathFollower, seen: VehicleView, *, limit: float, now: float
    ) -> bool:
        """Return whether it made no progress for ``limit`` seconds, or over BLIND commanded."""
        leg, (forward, turned) = course.leg, self._last
        lives = self._lives(seen, has_one_try=course.has_one_try)
        turns = self._turns_by_itself(seen) and not seen.still and self._turned < FULL_TURNS
        if leg.has_end:
            asked, left = turned if leg.unit is Unit.RADIANS else forward, abs(course.remaining)
            moves = left < self._best_remaining - PROGRESS
            if moves:
                self._best_remaining, self._turned = left, 0.0
        else:
            asked = max(forward, turned)
            moves = not seen.still or not asked
        if moves or turns:
            self._progress_at, self._commanded = now, 0.0
        if not (moves or lives):
            self._commanded += asked
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
        return is_far_off(wrap(self._course - yaw))


class AstrayWatch:
    """Detector of a vehicle that does not go where it is told, for one task.

    There are two signs: the vehicle moves in another direction than it points, or it drives off its
    line.
    """

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
        if self._is_asked:
            self._rolls_on |= velocity.forward * self._asked < 0.0
            self._asked = velocity.forward

    def is_astray(self, course: PathFollower, motion: Motion) -> bool:
        """Return whether the vehicle's motion contradicts its setpoints; call with each motion."""
        last, self._last = self._last, motion
        if motion is last:
            return False
        elapsed = 0.0 if last is None else max(0.0, motion.at - last.at)
        most = WRONG_WAY_OF_ONE_TRY if course.has_one_try else WRONG_WAY
        goes_wrong = self._goes_wrong(motion, most=most, elapsed=elapsed)
        return self._has_left(course, motion, last, elapsed=elapsed) or goes_wrong

    def _goes_wrong(self, motion: Motion, *, most: float, elapsed: float) -> bool:
        """Return whether it has driven the wrong way, by its reported speed and its position.

        Reported speeds alone add up to metres for a rover that stands or crawls: with metre-class
        GPS they are off by 0.3 m/s for minutes (PX4 1.17).
        """
        speed, here, ahead = motion.speed, motion.pose, copysign(1.0, self._asked)
        if speed < MOVES:
            self._rolls_on = False
        elif not self._is_asked:
            pass  # it may roll on, or drift while it turns on the spot
        elif ahead * motion.forward >= ALONG * speed:
            self._rolls_on, self._wrong = False, 0.0
        elif not self._rolls_on:
            if self._wrong == 0.0:
                self._wrong_from = here
            self._wrong += speed * elapsed
        if self._wrong <= most:
            return False
        way = distance(self._wrong_from, here)
        along = ahead * forward_of(replace(self._wrong_from, yaw=here.yaw), here)
        if way <= WENT * most or along >= ALONG * way:
            self._wrong = 0.0
        return self._wrong > most

    def _has_left(
        self, course: PathFollower, motion: Motion, last: Motion | None, *, elapsed: float
    ) -> bool:
        """Return whether it has driven off its line; a corrected position does not count."""
        leg, here, before = course.leg, motion.pose, self._beside
        aside = leg.beside(course.anchor, here, course.progress.done)
        if aside is None:
            self._least = None
            return False
        self._beside = aside
        is_turning = self._course is not None and abs(wrap(self._course - here.yaw)) > TURNS
        if self._least is None or last is None or is_turning:
            self._least = self._beside
        elif distance(last.pose, here) > CORRECTED + 2 * motion.speed * elapsed:
            self._least += self._beside - before
        self._least = min(self._least, self._beside)
        return self._beside - self._least > OFF_TRACK


class JumpWatch:
    """Detector of jumps of one vehicle's pose: more than it can have driven or turned."""

    def __init__(self) -> None:
        #: the motion at the last look
        self.last: Motion | None = None

    def has_jumped(self, motion: Motion | None, *, driving: Driving) -> bool:
        """Return whether the vehicle cannot have got to this pose from the last; remember it."""
        last = self.last
        if motion is None or motion is last:
            return False
        self.last = motion
        if last is None:
            return False
        here, there, elapsed = motion.pose, last.pose, max(0.0, motion.at - last.at)
        if abs(wrap(here.yaw - there.yaw)) > TURN + 2 * driving.max_turn_rate * elapsed:
            return True
        return distance(here, there) > JUMP + 2 * driving.max_speed * elapsed
