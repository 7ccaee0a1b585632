"""Controls the end of a leg: the rover stops as close to it as it can.

Below some speed a rover's wheels stand still, and at that speed it still rolls on after a zero.
Both values differ tenfold between rovers (0.02 to 0.5 m/s and 0.1 to 1.7 s were measured), so both
are learnt while it drives. Near its end a leg is driven at the lowest speed that moves the rover,
and zero is commanded where the rover will roll to the end. A rover that stands within the tolerance
has arrived. Otherwise the end is corrected a limited number of times. After that, an error within
the settling distance is good enough, and the task's status shows it.
"""

from math import radians

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import Unit
from mav_tasks.kinds.guidance import (
    APPROACH_GAIN,
    CREEP_RATE,
    CREEP_SPEED,
    TURN_GAIN,
    Motion,
    Slowest,
    Velocity,
)
from mav_tasks.tasks.driving.path_follower import PathFollower

CORRECTIONS = 2  # corrections of the end from a standstill
STALLED = 4.0  # s without progress, within the settling distance, after which it stops
NEARER = 0.005  # m or rad; less is no progress
ASKED = 0.7  # s of a slow setpoint without effect, after which the least speed is raised
NEAR = 0.5  # m or rad from the end; farther off, slowness has other reasons
TURNS = radians(5)  # rad/s; above this a move still turns to its heading
EFFECT = 0.2  # of the distance commanded; less is no effect
RAISE = 1.6  # factor on the least speed when it had no effect
MOST_CREEP = 0.4  # m/s or rad/s, to which it is raised at most
LONGEST_LAG = 2.5  # s; 1.7 was measured
MOST_COAST = 0.12  # m or rad; zero is commanded at most this far before the end
#: the same for a car, which rolls out: 0.47 m from 0.5 m/s and 0.96 m from 1 m/s (ArduPilot)
MOST_COAST_OF_CAR = 1.0  # m
#: m/s, the least setpoint for a car that is steered by course. Below it PX4's speed loop sticks and
#: slips: at 0.3 it drove 0.1, and at 0.15 it went 0.3 m in one leap.
LEAST_OF_ONE_TRY = 0.5
TELLING = 0.3  # m/s; above it a car's stops are alike, from 0.05 it rolls on for half as long
LAG_OF_CAR = 0.6  # s, until it is learnt: 0.5 and 0.7 were measured (ArduPilot)
LAG_OF_ONE_TRY = 0.3  # s, until it is learnt: 0.15 (SIH) and 0.4 (at 1 m/s²) were measured
GAIN_BY_LAG = 0.7  # gain times lag; a rover that rolls on for longer approaches slower


class Creeping:
    """Learnt low-speed behaviour of one rover, along or around; kept for all its tasks."""

    def __init__(
        self, *, least: float, lag: float, most: float = MOST_COAST, telling: float = CREEP_RATE
    ) -> None:
        self._least_known, self._most = least, most
        self._telling = telling  # m/s or rad/s; slower stops count less
        self.least = least  # m/s or rad/s that moves it
        self.lag = lag  # s; times the speed, it is how far the rover rolls on after zero

    def __repr__(self) -> str:
        return f"Creeping(least {self.least:.3f}, rolls on {self.lag:.2f} s)"

    def coast(self, speed: float) -> float:
        """Return how far before the end to command zero, m or rad."""
        return min(abs(speed) * self.lag, self._most)

    def gain(self, usual: float) -> float:
        """Return the speed per remaining distance, 1/s, that does not overshoot."""
        return min(usual, GAIN_BY_LAG / self.lag) if self.lag > 0 else usual

    def rolled_on(self, way: float, speed: float) -> None:
        """Learn from the distance ``way`` that it rolled on after zero was commanded at a speed."""
        if speed > 0:
            seen = max(0.0, min(LONGEST_LAG, way / speed))
            self.lag += (0.5 * min(1.0, speed / self._telling)) * (seen - self.lag)

    def overshot(self) -> None:
        """Lower the least speed, since the rover overshot the end."""
        self.least = max(self._least_known, self.least / RAISE)

    def begins_again(self) -> None:
        """Lower the least speed a little for another leg: the ground may have been the cause."""
        self.least = max(self._least_known, 0.8 * self.least)


class Arrival:
    """Arrival control of one rover; ``begin_leg`` precedes each leg."""

    def __init__(self) -> None:
        self.along = Creeping(least=CREEP_SPEED, lag=0.1)
        self.around = Creeping(least=CREEP_RATE, lag=0.05)
        self.as_car = Creeping(
            least=CREEP_SPEED, lag=LAG_OF_CAR, most=MOST_COAST_OF_CAR, telling=TELLING
        )
        self.in_one_try = Creeping(
            least=LEAST_OF_ONE_TRY, lag=LAG_OF_ONE_TRY, most=MOST_COAST_OF_CAR, telling=TELLING
        )
        self._best = 0.0  # the least that remained
        self.begin_leg()

    def __repr__(self) -> str:
        return f"Arrival({self.along}, {self.around}, corrected {self._corrections} times)"

    def slowest(self, course: PathFollower) -> Slowest:
        """Return the learnt values for the end of a leg."""
        along, around = self._driven(course), self.around
        return Slowest(along.least, around.least, along.gain(APPROACH_GAIN), around.gain(TURN_GAIN))

    def begin_leg(self) -> None:
        """Reset for another leg."""
        self._is_settling = False  # zero is commanded until it stands
        self._gives_up = False  # accept the error, if the end is near
        self._corrections = 0
        self._left_at_zero: tuple[float, float] | None = None  # what remained, at which speed
        self._best_at: float | None = None  # when the least remained
        #: since when a slow speed is commanded, what remained then, and the least speed since
        self._crept: tuple[float, float, float] | None = None
        for creeping in (self.along, self.around, self.as_car, self.in_one_try):
            creeping.begins_again()

    def stands_here(
        self,
        course: PathFollower,
        motion: Motion,
        last: Velocity,
        *,
        stands: bool,
        driving: Driving,
        now: float,
    ) -> bool:
        """Return whether to command zero: the rover is at the end, or as near as it gets.

        ``last`` is the last velocity commanded. If the rover also ``stands``, it has arrived.
        """
        leg, left = course.leg, abs(course.remaining)
        if not leg.has_end:
            return course.has_arrived(stands=stands, driving=driving)
        is_turn = leg.unit is Unit.RADIANS
        creeping = self.around if is_turn else self._driven(course)
        if stands:
            return self._judge(course, creeping, driving=driving)
        if self._best_at is None or left < self._best - NEARER:
            self._best, self._best_at = left, now
        is_stalled = self._gives_up or now - self._best_at > STALLED
        self._gives_up = is_stalled and course.is_settled(driving=driving)
        asked = abs(last.yaw_rate if is_turn else last.forward)
        turns_to_heading = leg.pivots and abs(motion.yaw_rate) > TURNS
        is_slow = 0.0 < asked <= MOST_CREEP and not turns_to_heading and left <= NEAR
        self._look_for_effect(course, creeping, asked if is_slow else None, now=now)
        if self._is_settling or self._gives_up:
            return True
        # measured, too: a rover slows down later than commanded
        speed = max(asked, abs(motion.yaw_rate if is_turn else motion.forward))
        if course.has_arrived(stands=False, driving=driving, coast=creeping.coast(speed)):
            self._is_settling = True
            self._left_at_zero = (course.remaining, speed) if speed else None
        return self._is_settling

    def _judge(self, course: PathFollower, creeping: Creeping, *, driving: Driving) -> bool:
        """Return whether a rover that stands has arrived; learn from its stop."""
        if self._is_settling and self._left_at_zero is not None:
            left, speed = self._left_at_zero
            creeping.rolled_on(left - course.remaining, speed)
        was_settling, self._is_settling, self._left_at_zero = self._is_settling, False, None
        if course.has_arrived(stands=True, driving=driving):
            return True
        if was_settling:
            self._corrections += 1
            if course.remaining < 0.0:
                creeping.overshot()
        most = 0 if course.has_one_try else CORRECTIONS
        return (self._gives_up or self._corrections > most) and course.is_settled(driving=driving)

    def _look_for_effect(
        self, course: PathFollower, creeping: Creeping, asked: float | None, *, now: float
    ) -> None:
        """Raise the least speed if a slow setpoint near the end has no effect."""
        if asked is None:
            self._crept = None
            return
        since, before, slowest = self._crept or (now, course.remaining, asked)
        slowest = min(slowest, asked)
        self._crept = since, before, slowest
        if now - since >= ASKED:
            if abs(before - course.remaining) < EFFECT * slowest * (now - since):
                creeping.least = max(creeping.least, min(MOST_CREEP, slowest * RAISE))
            self._crept = None

    def _driven(self, course: PathFollower) -> Creeping:
        if course.has_one_try:
            return self.in_one_try
        return self.along if course.steering is None else self.as_car
