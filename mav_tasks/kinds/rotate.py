"""Rotate and Face: turn on the spot, by an angle or to a heading."""

from dataclasses import dataclass, replace
from math import copysign, degrees, pi, radians, tau
from typing import ClassVar

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Number
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import (
    OFF_TRACK,
    ON_SPOT,
    TURNED,
    Ability,
    Base,
    Begun,
    Leg,
    Took,
    Unit,
    WhyNot,
    anchor_in,
    is_turned,
    ramped,
)
from mav_tasks.kinds.form import DEGREE, HEADING, RATE, Form, any_number
from mav_tasks.kinds.guidance import Situation, Velocity, approach
from mav_tasks.kinds.params import (
    Given,
    Parsers,
    bad,
    flag,
    number,
    rate_or_default,
    refuse_reserved,
    whole,
)
from mav_tasks.kinds.path import distance, wrap
from mav_tasks.kinds.places import Pose
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd

AHEAD = 0.5  # s by which the course leads the heading if a vehicle turns to it by itself
LEAST_AHEAD = radians(10)  # rad, least lead
UNSEEN = 3.0  # rad; a larger turn looks like a smaller one the other way


@dataclass(frozen=True, slots=True)
class Rotate(Leg):
    """Turn on the spot: ``angle`` in radians, clockwise positive, may exceed a full turn.

    ``rate`` in rad/s, positive, None = default.
    """

    rule: ClassVar[str] = "rotate"
    unit: ClassVar[Unit] = Unit.RADIANS
    angle: float
    rate: float | None = None

    @property
    def words(self) -> str:
        return f"rotate {degrees(self.angle):.6g} deg"

    @property
    def sent(self) -> tuple[Sent, ...]:
        return (Sent(MavCmd.TASK_ROTATE, degrees(self.angle), degrees(self.rate or 0.0)),)

    def why_not(self, ability: Ability) -> WhyNot | None:
        return None if ability.may_spin else WhyNot(ability.why_no_turn)

    @property
    def length(self) -> float:
        return abs(self.angle)

    def loses_count(self, progress: Begun) -> bool:  # noqa: ARG002
        return abs(self.angle) > UNSEEN

    def begun_from(self, pose: Pose, done: float) -> Pose:
        return replace(pose, yaw=wrap(pose.yaw - copysign(done, self.angle)))

    def done_so_far(
        self,
        anchor: Pose,
        pose: Pose,
        *,
        before: float,
        elapsed: float = 0.0,  # noqa: ARG002
    ) -> float:
        """The radians turned. Full turns count: it is the value nearest to ``before`` that fits
        the measured heading, if the vehicle is seen at least twice in half a turn.
        """
        turned = copysign(1.0, self.angle) * (pose.yaw - anchor.yaw)
        return before + wrap(turned - before)

    def steer(self, now: Situation) -> Velocity:
        towards_end = approach(
            now.remaining,
            top=self.rate or now.driving.turn_rate,
            braking=now.driving.turn_acceleration,
            gain=now.slowest.turn_gain,
            creep=now.slowest.rate,
        )
        turn = copysign(towards_end, self.angle * now.remaining)
        if not now.by_course:
            return Velocity(0.0, turn)
        # it turns by itself at its full rate: keep the lead small
        ahead = max(LEAST_AHEAD, AHEAD * abs(turn))
        lead = copysign(min(abs(now.remaining), ahead), turn)
        return Velocity(0.0, 0.0, wrap(now.motion.pose.yaw + lead))

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:  # noqa: ARG002
        seconds = ramped(left, self.rate or driving.turn_rate, driving.turn_acceleration)
        return Took(seconds, 0.0, replace(anchor, yaw=wrap(anchor.yaw + self.angle)))

    def is_left(self, anchor: Pose, pose: Pose, done: float) -> bool:  # noqa: ARG002
        return distance(pose, anchor) > OFF_TRACK

    def way_back(
        self,
        anchor: Pose,
        pose: Pose,
        done: float,
        *,
        by_course: bool,  # noqa: ARG002
        is_car: bool,  # noqa: ARG002
    ) -> Pose | None:
        there = replace(anchor, yaw=wrap(anchor.yaw + copysign(done, self.angle)))
        is_there = distance(pose, there) <= ON_SPOT and not is_turned(pose, there, TURNED)
        return None if is_there else there


@dataclass(frozen=True, slots=True)
class Face(Base):
    """Turn on the spot to a heading.

    ``yaw`` in radians from north; ``direction`` 1 clockwise, -1 counter-clockwise, 0 the shorter
    way; ``rate`` in rad/s, None = default.
    """

    rule: ClassVar[str] = "rotate"
    is_absolute: ClassVar[bool] = True
    yaw: float
    direction: int = 0
    rate: float | None = None

    @property
    def words(self) -> str:
        return f"face {degrees(self.yaw) % 360:.6g} deg"

    @property
    def sent(self) -> tuple[Sent, ...]:
        heading, rate = degrees(self.yaw) % 360.0, degrees(self.rate or 0.0)
        return (Sent(MavCmd.CONDITION_YAW, heading, rate, float(self.direction)),)

    def why_not(self, ability: Ability) -> WhyNot | None:
        return None if ability.may_spin else WhyNot(ability.why_no_turn)

    def leg_of(self, progress: Begun) -> Rotate:
        return Rotate(turn_to(anchor_in(progress).yaw, self.yaw, self.direction), self.rate)


def turn_to(have: float, want: float, direction: int) -> float:
    """Return the angle between two headings, in ``direction``, or the shorter way if that is 0."""
    short = wrap(want - have)
    if direction == 0 or short * direction >= 0 or abs(abs(short) - pi) < 1e-9:
        return copysign(short, direction) if direction else short
    return short + direction * tau


def _face(heading: float, direction: int | None, rate: float | None) -> Face:
    return Face(heading, direction or 0, rate)


def _rotate(command: Given, driving: Driving) -> Rotate:
    turn = degrees(driving.max_turn)
    angle = number(command, 1, "angle", low=-turn, high=turn)
    rate = rate_or_default(command, 2, driving)
    refuse_reserved(command, 3)
    if angle == 0.0:
        raise bad("param1 angle is 0: nothing to do", param=1)
    return Rotate(radians(angle), rate)


def _condition_yaw(command: Given, driving: Driving) -> Face | Rotate:
    angle = number(command, 1, "angle", low=-360.0, high=360.0)
    rate = rate_or_default(command, 2, driving)
    direction = whole(command, 3, "direction", low=-1, high=1)
    if not flag(command, 4, "relative"):
        return Face(radians(angle), direction, rate)
    if angle == 0.0:
        raise bad("param1 angle is 0: nothing to do", param=1)
    return Rotate(radians(angle if direction >= 0 else -angle), rate)


#: how its commands are read
PARSERS: Parsers = {
    MavCmd.TASK_ROTATE: _rotate,
    MavCmd.CONDITION_YAW: _condition_yaw,
}

FORMS = (
    Form(
        "rotate",
        "Turn by an angle",
        "Turn on the spot by an angle.",
        (Part("angle", any_number("deg", DEGREE), "angle; positive: clockwise", True), RATE),
        Rotate,
    ),
    Form(
        "face",
        "Face a heading",
        "Turn on the spot to a heading.",
        (
            Part("heading", any_number("deg", DEGREE), HEADING, True),
            Part(
                "direction",
                Number(-1, 1, is_whole=True),
                "1 clockwise, -1 counter-clockwise, 0 or not given: the shorter",
            ),
            RATE,
        ),
        _face,
    ),
)
