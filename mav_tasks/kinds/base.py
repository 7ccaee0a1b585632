"""What the server asks of a goal, or a step of a plan; a kind answers what is special about it."""

from typing import Any, NamedTuple, Protocol

from mav_tasks.kinds.places import Bend, LocalPlace, Pose
from mav_tasks.settings import Turning

#: the legs of a way to a place: face it (as a car: drive to where the last run to it begins),
#: drive there; others may follow
FACE, WAY = range(2)


class Ability(NamedTuple):
    """How a vehicle moves; ``rover`` is its name in refusals."""

    honours_yaw_rate: bool = True
    turning: Turning = Turning.ON_SPOT
    rover: str = "this rover"
    turns_by_course: bool = False  # turns on the spot to the course of a setpoint

    @property
    def is_steered(self) -> bool:
        """Whether it turns only while it rolls, as a car."""
        return self.turning is Turning.STEERED

    @property
    def drives_everything(self) -> bool:
        """Whether it follows every setpoint."""
        return self.honours_yaw_rate and self.turning is Turning.ON_SPOT

    @property
    def turns_on_spot(self) -> bool:
        """Whether the vehicle turns while it stands."""
        return self.drives_everything or self.turns_by_course

    @property
    def why_no_turn(self) -> str:
        """Text: why it does not turn while it stands."""
        if self.is_steered:
            return f"{self.rover} steers like a car and cannot turn on the spot"
        return f"{self.rover} can neither turn on the spot nor follow a yaw rate"

    @property
    def why_no_rate(self) -> str:
        """Text: why it does not turn at a rate."""
        if self.is_steered:
            return f"{self.rover} is steered by course and cannot follow a yaw rate"
        return self.why_no_turn

    @property
    def why_no_reverse(self) -> str:
        """Text: why it does not reverse."""
        return f"{self.rover} cannot reverse"

    @property
    def may_spin(self) -> bool:
        """Whether a goal may turn it on the spot."""
        return not self.is_steered and (self.honours_yaw_rate or self.turns_on_spot)


class WhyNot(NamedTuple):
    """Why a vehicle cannot drive a goal, and the number of the parameter that it is about, or 0."""

    words: str
    param: int = 0


class Begun(Protocol):
    """How far a task has got, as far as a leg follows from it: see ``Progress``."""

    @property
    def anchor(self) -> Pose | None: ...

    @property
    def leg(self) -> int: ...

    @property
    def target(self) -> LocalPlace | None: ...

    @property
    def path(self) -> tuple[Bend, ...]: ...


def anchor_in(progress: Begun) -> Pose:
    """Return the pose where the present leg has begun."""
    assert progress.anchor is not None, "a leg is driven from its anchor"
    return progress.anchor


class Base:
    """The usual answers."""

    __slots__ = ()

    @property
    def named_speed(self) -> float:
        """The speed that it names, m/s; 0 if it names none."""
        return 0.0

    def why_not(self, ability: Ability) -> WhyNot | None:  # noqa: ARG002
        """Why a vehicle of this ability cannot drive it; None: it can."""
        return None

    def as_driven(self, ability: Ability) -> tuple[Any, str]:  # noqa: ARG002
        """It as a vehicle of this ability drives it, and a text if that differs, or ""."""
        return self, ""

    # its legs, each counted from its own anchor. They depend only on the goal, on the pose where
    # each one began and on the place meant, so that a resumed task drives the very same ones.

    @property
    def leg_count(self) -> int:
        """The number of its legs."""
        return 1

    def anchor_of(self, leg: int, pose: Pose, target: LocalPlace | None) -> Pose:  # noqa: ARG002
        """The anchor of a leg that begins at ``pose``."""
        return pose

    def leg_of(self, progress: Begun) -> Any:  # noqa: ARG002
        """The leg that is being driven: a goal that ``guidance`` can steer."""
        return self

    def begun_from(self, pose: Pose, done: float) -> Pose:  # noqa: ARG002
        """The anchor if a vehicle that stands at ``pose`` has already driven ``done``.

        It is for a task that resumes from here because its own anchor is lost.
        """
        return pose

    def done_so_far(
        self,
        anchor: Pose,  # noqa: ARG002
        pose: Pose,  # noqa: ARG002
        *,
        before: float,
        elapsed: float = 0.0,
    ) -> float:
        """Of a leg: the metres along it, the radians turned, or the seconds, since the anchor.

        ``before`` is the last such value, and ``elapsed`` the time since. The result is negative if
        the vehicle is behind its anchor.
        """
        return before + elapsed
