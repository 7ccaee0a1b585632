"""Follows one goal, leg after leg: where the vehicle is → the velocity to command, or the end."""

from dataclasses import dataclass, replace

from mav_tasks.config.settings import Driving
from mav_tasks.kinds import GoTo, Leg, Pose, SingleGoal, Unit
from mav_tasks.kinds.base import FACE, WAY
from mav_tasks.kinds.guidance import USUAL, Motion, Situation, Slowest, Velocity
from mav_tasks.kinds.path import distance
from mav_tasks.tasks.driving.legs import begun_leg
from mav_tasks.tasks.driving.planner import Steering, set_out_to
from mav_tasks.tasks.task import Progress

BESIDE = 0.15  # m from a place, at the end of the way there; farther off has missed it
#: m, the same for a car that cannot reverse: to come nearer it would drive a full circle
BESIDE_OF_LOOP = 0.4
TURNED_ROUND = 0.1  # m from the end of a run, where a car changes its direction: close enough
ONE_TRY = 3.0  # factor on the settling distance of a car that is steered by course
MOVING_TOLERANCE = 0.4  # of the tolerance: zero is commanded nearer to the end than required


@dataclass(slots=True, repr=False, eq=False)
class PathFollower:
    """Follower of one goal; ``progress`` is enough to resume it."""

    goal: SingleGoal
    progress: Progress
    #: m/s at the end of a way that goes on to another place; 0: it stops
    passing: float = 0.0
    #: m from that end at which it goes on
    within: float = 0.0
    #: whether the vehicle is steered by course, and does not reverse
    by_course: bool = False
    #: how a car steers; None: the vehicle turns on the spot
    steering: Steering | None = None
    #: how often a place was missed and driven to again
    misses: int = 0
    #: the current leg, which each set-point reads several times, and what it follows from
    _leg: Leg | None = None
    _leg_of: tuple[object, ...] = ()

    def __repr__(self) -> str:
        return f"PathFollower({self.goal}, {self.progress})"

    @property
    def leg(self) -> Leg:
        """The current leg."""
        progress = self.progress
        of = progress.leg, progress.anchor, progress.target, progress.path
        if self._leg is None or of != self._leg_of:
            self._leg, self._leg_of = self.goal.leg_of(progress), of
        return self._leg

    @property
    def remaining(self) -> float:
        """Rest of the current leg in m, rad or s; negative beyond its end."""
        return self.leg.length - self.progress.done

    @property
    def has_one_try(self) -> bool:
        """Whether an error at the end cannot be corrected: a car that is steered by course."""
        return self.by_course and self.steering is not None

    @property
    def is_circle(self) -> bool:
        """Whether it drives round a place, and not to it."""
        return isinstance(self.goal, GoTo) and self.goal.turns > 0

    @property
    def is_passing(self) -> bool:
        """Whether the current leg ends without a stop."""
        return self.passing > 0.0 and self.progress.leg == WAY

    @property
    def anchor(self) -> Pose:
        """Pose at which the current leg began."""
        assert self.progress.anchor is not None, "a course has an anchor"
        return self.progress.anchor

    @property
    def _to_correct(self) -> float:
        """Rest of the leg; steered by course, a vehicle cannot drive back from beyond the end."""
        is_one_way = self.by_course and self.leg.unit is Unit.METRES
        return max(self.remaining, 0.0) if is_one_way else self.remaining

    def metres_to_place(self, motion: Motion) -> float | None:
        """Return how far the place is that it drives to; None without one."""
        target = self.progress.target
        return None if target is None else distance(motion.pose, target)

    def has_passed(self, motion: Motion) -> bool:
        """Return whether a place to pass is near enough to go on to the next."""
        away = self.metres_to_place(motion) if self.is_passing else None
        return away is not None and away <= self.within

    def look(self, motion: Motion, *, elapsed: float) -> None:
        """Update the progress from the motion, ``elapsed`` seconds after the last look."""
        before = self.progress.done
        done = self.leg.done_so_far(self.anchor, motion.pose, before=before, elapsed=elapsed)
        self.progress = replace(self.progress, done=done)
        if self.is_passing and self.remaining <= 0.0 and not self.has_passed(motion):
            self.passing = 0.0  # missed: it stops, and tries again from there

    def has_arrived(self, *, stands: bool, driving: Driving, coast: float = 0.0) -> bool:
        """Return whether to stop here: near the end while moving, within the tolerance at rest.

        ``coast`` is how far the vehicle will roll on, m or rad.
        """
        remaining = self.remaining
        if self.is_passing:
            return False
        if self.progress.leg == FACE and self.progress.path:
            return remaining <= TURNED_ROUND
        if isinstance(self.goal, GoTo) and self.progress.leg == WAY:
            if remaining < -BESIDE:
                return True  # it stops, and faces the place again from there
            if self.goal.radius:
                return abs(remaining) <= self.goal.radius
        remaining = self._to_correct
        if not stands and 0.0 <= remaining <= coast:
            return True
        within = 1.0 if stands else MOVING_TOLERANCE
        return self.leg.is_within(
            remaining,
            metres=within * driving.arrival_distance,
            angle=within * driving.arrival_angle,
        )

    def is_settled(self, *, driving: Driving) -> bool:
        """Return whether the end is near enough for a rover that can come no nearer.

        A wider limit holds for a car that is steered by course: it has one try only.
        """
        metres = driving.settle_distance * (ONE_TRY if self.has_one_try else 1.0)
        return self.leg.is_within(
            self._to_correct,
            metres=max(metres, driving.arrival_distance),
            angle=max(driving.settle_angle, driving.arrival_angle),
        )

    def advance(self, motion: Motion) -> bool:
        """Begin the next leg where the vehicle stands. Return False if there is none.

        If the vehicle stands beside the place, because its position was corrected meanwhile, it
        drives there again. A car begins its next run to the place until it is reached.
        """
        goal, before, target = self.goal, self.progress.leg, self.progress.target
        following, has_missed = before + 1, False
        if isinstance(goal, GoTo) and target is not None and before <= WAY:
            near = max(goal.radius or 0.0, BESIDE_OF_LOOP if self.has_one_try else BESIDE)
            is_reached = self.is_circle or distance(motion.pose, target) <= near
            has_missed = before == WAY and not is_reached
            if self.steering is not None and (has_missed or before < WAY):
                self.progress = set_out_to(goal, self.progress, motion.pose, target, self.steering)
                self.misses += self.progress.leg <= before  # this run should have been the last
                return True
        if has_missed:
            following = WAY if self.by_course else FACE
            self.misses += 1
        if following >= goal.leg_count:
            return False
        self.progress = begun_leg(goal, self.progress, following, motion.pose)
        return True

    def steer(
        self,
        motion: Motion,
        *,
        driving: Driving,
        speed: float | None,
        slowest: Slowest = USUAL,
    ) -> Velocity:
        """Return the velocity towards the leg's end; ``speed`` in m/s overrides the leg's own."""
        leg, remaining = self.leg, self.remaining
        if speed is not None:
            leg = leg.at_speed(speed)
        passing = self.passing if self.is_passing else 0.0
        if passing and remaining > 0:
            remaining = max(remaining - self.within, 0.0)
        return leg.steer(
            Situation(
                self.anchor,
                motion,
                self.progress.done,
                remaining,
                driving,
                passing,
                self.by_course,
                None if self.steering is None else self.steering.radius,
                not self.is_circle,
                slowest,
            )
        )
