"""Move: drive straight along the heading at the start."""

from dataclasses import dataclass
from math import copysign, pi
from typing import ClassVar

from mav_tasks.kinds.base import WAY, Ability, Base, Begun, WhyNot
from mav_tasks.kinds.form import SPEED, Form, any_number
from mav_tasks.kinds.path import forward_of, moved
from mav_tasks.kinds.places import Pose
from mav_tasks.kinds.rotate import Rotate
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.setting_keys.parts import Part


@dataclass(frozen=True, slots=True)
class Move(Base):
    """Drive straight along the heading at the start.

    ``distance`` in metres, negative = backwards; ``speed`` in m/s, positive, None = default.
    """

    rule: ClassVar[str] = "move"
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
        """Its whole length, m."""
        return abs(self.distance)

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

    def _goes_on(self, ability: Ability) -> bool:
        return self.distance >= 0 or ability.honours_yaw_rate


@dataclass(frozen=True, slots=True)
class MoveTurned(Base):
    """Move backwards with a vehicle that cannot reverse: turn round, drive, turn back.

    ``distance`` in metres, positive; ``speed`` as in Move.
    """

    rule: ClassVar[str] = "move"
    distance: float
    speed: float | None = None

    @property
    def words(self) -> str:
        return f"move {-self.distance:g} m"

    @property
    def named_speed(self) -> float:
        return self.speed or 0.0

    @property
    def leg_count(self) -> int:
        return 3

    def leg_of(self, progress: Begun) -> Move | Rotate:
        return Move(self.distance, self.speed) if progress.leg == WAY else Rotate(pi)


FORM = Form(
    "move",
    "Move straight",
    "Drive straight along the heading that the rover has at the start.",
    (Part("distance", any_number("m"), "distance; negative: backwards", True), SPEED),
    Move,
)
