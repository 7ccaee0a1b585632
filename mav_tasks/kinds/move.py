"""Move: drive straight along the heading at the start."""

from dataclasses import dataclass, replace
from math import atan, copysign, pi, radians
from typing import ClassVar

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import (
    OFF_TRACK,
    ON_SPOT,
    PAST_END,
    TURNED,
    WAY,
    Ability,
    Base,
    Begun,
    Leg,
    Took,
    Unit,
    WhyNot,
    is_turned,
    ramped,
)
from mav_tasks.kinds.form import SPEED, Form, any_number
from mav_tasks.kinds.guidance import (
    MAX_APPROACH_ANGLE,
    Situation,
    Velocity,
    approach,
    clamped,
    towards,
)
from mav_tasks.kinds.params import Given, Parsers, bad, number, refuse_reserved, speed_or_default
from mav_tasks.kinds.path import Spot, cross_track, forward_of, moved, seen_from, wrap
from mav_tasks.kinds.places import Pose
from mav_tasks.kinds.rotate import Rotate
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd

CROSS_TRACK_GAIN = 1.2  # 1/m, sideways error -> approach angle
CONVERGES = 6.0  # m of line in which steering corrects one metre of cross-track error
PUT_BACK = 0.3  # m against its direction; no estimate wanders as far in half a minute
ALIGNED = radians(10)  # rad; a smaller heading error is corrected on the way


@dataclass(frozen=True, slots=True)
class Move(Leg):
    """Drive straight along the heading at the start.

    ``distance`` in metres, negative = backwards; ``speed`` in m/s, positive, None = default.
    """

    rule: ClassVar[str] = "move"
    stays: ClassVar[bool] = False
    unit: ClassVar[Unit] = Unit.METRES
    pivots: ClassVar[bool] = True
    distance: float
    speed: float | None = None

    @property
    def words(self) -> str:
        return f"move {self.distance:g} m"

    @property
    def named_speed(self) -> float:
        return self.speed or 0.0

    @property
    def sent(self) -> tuple[Sent, ...]:
        return (Sent(MavCmd.TASK_MOVE, self.distance, self.speed or 0.0),)

    def why_not(self, ability: Ability) -> WhyNot | None:
        if self._goes_on(ability) or ability.turns_on_spot:
            return None
        return WhyNot(f"param1 distance {self.distance:g}: {ability.why_no_reverse}", 1)

    def as_driven(self, ability: Ability) -> tuple["Move | MoveTurned", str]:
        if self._goes_on(ability):
            return self, ""
        words = f"{ability.why_no_reverse}: it turns round, drives, turns back"
        return MoveTurned(-self.distance, self.speed), words

    @property
    def length(self) -> float:
        return abs(self.distance)

    def at_speed(self, speed: float) -> "Move":
        return replace(self, speed=speed)

    def end_of(self, progress: Begun) -> Spot | None:
        return progress.anchor and moved(progress.anchor, 0.0, self.distance)

    def begun_from(self, pose: Pose, done: float) -> Pose:
        return moved(pose, 0.0, -copysign(done, self.distance))

    def done_so_far(
        self,
        anchor: Pose,
        pose: Pose,
        *,
        before: float,  # noqa: ARG002
        elapsed: float = 0.0,  # noqa: ARG002
    ) -> float:
        return copysign(1.0, self.distance) * forward_of(anchor, pose)

    def steer(self, now: Situation) -> Velocity:
        towards_end = approach(
            now.remaining,
            top=self.speed or now.driving.speed,
            braking=now.driving.acceleration,
            gain=now.slowest.gain,
            creep=now.slowest.speed,
            at_end=now.passing,
        )
        forward = copysign(towards_end, self.distance * now.remaining)
        return towards(_heading_error(now.anchor, now.motion.pose, forward=forward), forward, now)

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:
        seconds = ramped(left, self.speed or speed, driving.acceleration)
        return Took(seconds, left, moved(anchor, 0.0, self.distance))

    def beside(self, anchor: Pose, pose: Pose, done: float) -> float:  # noqa: ARG002
        return abs(cross_track(anchor, pose))

    def is_left(self, anchor: Pose, pose: Pose, done: float) -> bool:  # noqa: ARG002
        along, aside = self._place_of(anchor, pose)
        return aside > OFF_TRACK or not -OFF_TRACK <= along <= self.length + PAST_END

    def was_handled(self, before: Pose, after: Pose) -> bool:
        """On a straight line a vehicle rolls on by itself, but does not turn or come back."""
        is_back = self._place_of(before, after)[0] < -PUT_BACK
        return is_turned(before, after, TURNED) or is_back

    def goes_on_from(self, anchor: Pose, pose: Pose, done: float, *, is_car: bool) -> bool:  # noqa: ARG002
        along, aside = self._place_of(anchor, pose)
        return aside <= OFF_TRACK and 0 <= along <= self.length

    def way_back(
        self, anchor: Pose, pose: Pose, done: float, *, by_course: bool, is_car: bool
    ) -> Pose | None:
        along, aside = self._place_of(anchor, pose)
        at, steers_back = min(max(done, 0.0), self.length), False
        if -ON_SPOT <= along <= self.length + PAST_END and aside <= OFF_TRACK:
            steers_back = aside <= ON_SPOT or aside * CONVERGES <= self.length - along
            at = at if steers_back else min(along, self.length)
            is_far = is_turned(pose, anchor, TURNED)
            if is_car and by_course and along <= self.distance and not is_far:
                return None  # it would drive a circle
        if steers_back:
            if not is_turned(pose, anchor, ALIGNED) or (by_course and not is_car):
                return None
            if not is_car:  # turn here, or it would leave the line
                return replace(pose, yaw=anchor.yaw)
        return moved(anchor, 0.0, copysign(at, self.distance))

    def _place_of(self, anchor: Pose, pose: Pose) -> tuple[float, float]:
        """The metres of a pose along the line, and to either side of it."""
        there = seen_from(anchor, pose)
        return copysign(1.0, self.distance) * there.real, abs(there.imag)

    def _goes_on(self, ability: Ability) -> bool:
        return self.distance >= 0 or ability.honours_yaw_rate


@dataclass(frozen=True, slots=True)
class MoveTurned(Base):
    """Move backwards with a vehicle that cannot reverse: turn round, drive, turn back.

    ``distance`` in metres, positive; ``speed`` as in Move.
    """

    rule: ClassVar[str] = "move"
    stays: ClassVar[bool] = False
    distance: float
    speed: float | None = None

    @property
    def words(self) -> str:
        return f"move {-self.distance:g} m"

    @property
    def named_speed(self) -> float:
        return self.speed or 0.0

    def why_not(self, ability: Ability) -> WhyNot | None:
        return None if ability.may_spin else WhyNot(ability.why_no_turn)

    @property
    def leg_count(self) -> int:
        return 3

    def end_of(self, progress: Begun) -> Spot | None:
        way = self.distance
        if progress.leg != WAY:
            way = -way if progress.leg < WAY else 0.0  # it has not turned round yet, or is there
        return progress.anchor and moved(progress.anchor, 0.0, way)

    def loses_count(self, progress: Begun) -> bool:
        return progress.leg != WAY

    def leg_of(self, progress: Begun) -> Move | Rotate:
        return Move(self.distance, self.speed) if progress.leg == WAY else Rotate(pi)


def _heading_error(anchor: Pose, pose: Pose, *, forward: float) -> float:
    """Return the angle to turn by to get back to the line; smaller at low speed."""
    way = copysign(1.0, forward)
    speed_share = min(1.0, abs(forward) / 0.2)  # below 0.2 m/s only the heading counts
    back = atan(CROSS_TRACK_GAIN * cross_track(anchor, pose)) * speed_share
    return wrap(anchor.yaw - way * clamped(back, MAX_APPROACH_ANGLE) - pose.yaw)


def _move(command: Given, driving: Driving) -> Move:
    longest = driving.max_distance
    distance = number(command, 1, "distance", low=-longest, high=longest)
    speed = speed_or_default(command, 2, driving)
    refuse_reserved(command, 3)
    if distance == 0.0:
        raise bad("param1 distance is 0: nothing to do", param=1)
    return Move(distance, speed)


#: how its commands are read
PARSERS: Parsers = {
    MavCmd.TASK_MOVE: _move,
}

FORM = Form(
    "move",
    "Move straight",
    "Drive straight along the heading that the rover has at the start.",
    (Part("distance", any_number("m"), "distance; negative: backwards", True), SPEED),
    Move,
)
