"""Drive and Head: keep a velocity for a time, with a yaw rate or on a heading."""

from dataclasses import dataclass, replace
from math import copysign, degrees, radians
from typing import ClassVar

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import Ability, Begun, Leg, Took, WhyNot, anchor_in
from mav_tasks.kinds.form import DEGREE, DURATION, Form, any_number
from mav_tasks.kinds.guidance import Situation, Velocity, towards
from mav_tasks.kinds.params import Given, Parsers, bad, flag, number
from mav_tasks.kinds.path import moved, wrap
from mav_tasks.kinds.places import Pose
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd


@dataclass(frozen=True, slots=True)
class Drive(Leg):
    """Keep a velocity for a time: m/s forward, rad/s clockwise, ``duration`` in seconds."""

    rule: ClassVar[str] = "drive"
    stays: ClassVar[bool] = False
    forward: float
    yaw_rate: float
    duration: float

    @property
    def words(self) -> str:
        return f"drive {self.forward:g} m/s for {self.duration:g} s"

    @property
    def named_speed(self) -> float:
        return abs(self.forward)

    @property
    def sent(self) -> tuple[Sent, ...]:
        return (Sent(MavCmd.TASK_DRIVE, self.forward, degrees(self.yaw_rate), self.duration),)

    def why_not(self, ability: Ability) -> WhyNot | None:
        if ability.is_steered and self.forward == 0.0 and self.yaw_rate:
            return WhyNot(f"param2 yaw rate: {ability.why_no_turn}", 2)
        if ability.honours_yaw_rate:
            return None
        if self.forward < 0:
            return WhyNot(f"param1 forward speed {self.forward:g}: {ability.why_no_reverse}", 1)
        return WhyNot(f"param2 yaw rate: {ability.why_no_rate}", 2) if self.yaw_rate else None

    @property
    def length(self) -> float:
        return self.duration

    def steer(self, now: Situation) -> Velocity:
        return Velocity(self.forward, self.yaw_rate, now.anchor.yaw if now.by_course else None)

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:  # noqa: ARG002
        curvature = self.yaw_rate / self.forward if self.forward else 0.0
        there = moved(anchor, curvature, self.forward * self.duration)
        turned = replace(there, yaw=wrap(anchor.yaw + self.yaw_rate * self.duration))
        return Took(left, abs(self.forward) * left, turned)


@dataclass(frozen=True, slots=True)
class Head(Leg):
    """Drive towards a heading for a time: ``yaw`` in radians, ``forward`` in m/s.

    ``is_relative``: the yaw counts from the heading at the start.
    """

    rule: ClassVar[str] = "drive"
    stays: ClassVar[bool] = False
    yaw: float
    forward: float
    duration: float
    is_relative: bool = False

    @property
    def words(self) -> str:
        return f"drive {self.forward:g} m/s on a heading for {self.duration:g} s"

    @property
    def named_speed(self) -> float:
        return abs(self.forward)

    def why_not(self, ability: Ability) -> WhyNot | None:
        if self.forward == 0.0 and not ability.may_spin:
            return WhyNot(f"param2 speed 0: {ability.why_no_turn}", 2)
        if self.forward < 0 and not ability.honours_yaw_rate:
            return WhyNot(f"param2 speed {self.forward:g}: {ability.why_no_reverse}", 2)
        return None

    @property
    def length(self) -> float:
        return self.duration

    def at_speed(self, speed: float) -> "Head":
        forward = copysign(speed, self.forward) if self.forward else 0.0
        return replace(self, forward=forward)

    def steer(self, now: Situation) -> Velocity:
        return towards(wrap(self.yaw - now.motion.pose.yaw), self.forward, now)

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:  # noqa: ARG002
        end = moved(replace(anchor, yaw=self.yaw), 0.0, self.forward * self.duration)
        return Took(left, abs(self.forward) * left, end)

    def leg_of(self, progress: Begun) -> "Head":
        if not self.is_relative:
            return self
        return replace(self, yaw=wrap(anchor_in(progress).yaw + self.yaw), is_relative=False)


HEAD_FOR = 3.0  # s that NAV_SET_YAW_SPEED drives: an autopilot's own setpoint time-out


def _drive(command: Given, driving: Driving) -> Drive:
    top, fastest = driving.max_speed, degrees(driving.max_turn_rate)
    forward = number(command, 1, "forward speed", low=-top, high=top, default=0.0)
    rate = number(command, 2, "yaw rate", low=-fastest, high=fastest, default=0.0)
    duration = number(command, 3, "duration", low=0.0, high=driving.max_duration)
    if duration == 0.0:
        raise bad("param3 duration is 0: nothing to do", param=3)
    if forward == rate == 0.0:
        raise bad("param1 speed and param2 rate are 0: nothing to do", param=1)
    return Drive(forward, radians(rate), duration)


def _set_yaw_speed(command: Given, driving: Driving) -> Head:
    angle = number(command, 1, "angle", low=-360.0, high=360.0)
    top = driving.max_speed
    speed = number(command, 2, "speed", low=-top, high=top)
    return Head(radians(angle), speed, HEAD_FOR, is_relative=flag(command, 3, "relative"))


#: how its commands are read
PARSERS: Parsers = {
    MavCmd.TASK_DRIVE: _drive,
    MavCmd.NAV_SET_YAW_SPEED: _set_yaw_speed,
}

FORM = Form(
    "drive",
    "Drive at a velocity",
    "Drive at a constant velocity for some time.",
    (
        Part("forward", any_number("m/s"), "speed; negative: backwards", True),
        Part("yaw_rate", any_number("deg/s", DEGREE), "yaw rate; positive: clockwise", True),
        DURATION,
    ),
    Drive,
)
