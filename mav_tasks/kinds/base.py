"""What the server asks of a goal, a step of a plan or a leg; a kind answers what is special."""

from enum import IntEnum
from math import radians, sqrt
from typing import Any, ClassVar, NamedTuple, Protocol, Self

from mav_tasks.config.settings import Driving, Turning
from mav_tasks.kinds.guidance import ZERO, Situation, Velocity
from mav_tasks.kinds.path import Spot, wrap
from mav_tasks.kinds.places import Bend, LocalPlace, Pose

#: the legs of a way to a place: face it (as a car: drive to where the last run to it begins),
#: drive there; others may follow
FACE, WAY = range(2)
OFF_TRACK = 1.0  # m off its line; farther off, a task does not resume after a takeover (lifecycle)
PAST_END = 0.1  # m, the same for the end of the line
ON_SPOT = 0.02  # m; nearer counts as there
TURNED = radians(30)  # rad; a smaller heading error cannot hide a whole turn


class Unit(IntEnum):
    """TASK_UNIT: what the remainder of a leg, or of a plan, is counted in."""

    NONE = 0
    METRES = 1
    RADIANS = 2
    SECONDS = 3
    ITEMS = 4


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


class Took(NamedTuple):
    """An estimate of the rest of a leg: seconds, metres of way, and the pose at its end."""

    seconds: float
    metres: float
    pose: Pose


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

    is_absolute: ClassVar[bool] = False  # it ends at a place or heading, wherever it begins
    stays: ClassVar[bool] = True  # it ends where it begins

    @property
    def named_speed(self) -> float:
        """The speed that it names, m/s; 0 if it names none."""
        return 0.0

    @property
    def is_instant(self) -> bool:
        """Whether it takes next to no time."""
        return False

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

    def leg_of(self, progress: Begun) -> "Leg":  # noqa: ARG002
        """The leg that is being driven."""
        assert isinstance(self, Leg), "a goal of several legs says which"
        return self

    def begun_from(self, pose: Pose, done: float) -> Pose:  # noqa: ARG002
        """The anchor if a vehicle that stands at ``pose`` has already driven ``done``.

        It is for a task that resumes from here because its own anchor is lost.
        """
        return pose

    def done_at(self, done: float, *, utc: float) -> float:  # noqa: ARG002
        """How much is done when it begins or resumes, of which ``done`` was before."""
        return done

    def released(self, done: float) -> float:
        """How much is done of what a person lets go on after an interruption of unknown outcome."""
        return done

    def end_of(self, progress: Begun) -> Spot | None:  # noqa: ARG002
        """Where it ends, if that is known."""
        return None

    def loses_count(self, progress: Begun) -> bool:  # noqa: ARG002
        """Whether a pose alone cannot tell how much of its leg is done."""
        return False


class Leg(Base):
    """A piece of a goal that is driven at one time; the answers are for one that lasts a time."""

    __slots__ = ()

    unit: ClassVar[Unit] = Unit.SECONDS
    is_standing: ClassVar[bool] = False  # the vehicle stands all the time
    pivots: ClassVar[bool] = False  # a vehicle that points elsewhere turns before it drives

    @property
    def length(self) -> float:
        """The whole of it, in its unit."""
        raise NotImplementedError

    @property
    def has_end(self) -> bool:
        """Whether it has an end to come nearer to; otherwise it lasts for a time."""
        return self.unit is not Unit.SECONDS

    def at_speed(self, speed: float) -> Self:  # noqa: ARG002
        """It at another speed, m/s."""
        return self

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

    def steer(self, now: Situation) -> Velocity:  # noqa: ARG002
        """The velocity to command now."""
        return ZERO

    def is_within(self, remaining: float, *, metres: float, angle: float) -> bool:
        """Whether its end is this near; a time has to be over."""
        if self.unit is Unit.SECONDS:
            return remaining <= 0.0
        return abs(remaining) <= (angle if self.unit is Unit.RADIANS else metres)

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:  # noqa: ARG002
        """An estimate of its rest, ``left``, at this speed if it names none."""
        return Took(left, 0.0, anchor)

    # where the vehicle may be

    def beside(self, anchor: Pose, pose: Pose, done: float) -> float | None:  # noqa: ARG002
        """The metres to either side of its line; None: it has none."""
        return None

    def is_left(self, anchor: Pose, pose: Pose, done: float) -> bool:  # noqa: ARG002
        """Whether a pose is so far off that a person must decide before it goes on."""
        return False

    def was_handled(self, before: Pose, after: Pose) -> bool:  # noqa: ARG002
        """Whether a vehicle that went from one pose to the other was moved by somebody else."""
        return False

    def goes_on_from(self, anchor: Pose, pose: Pose, done: float, *, is_car: bool) -> bool:  # noqa: ARG002
        """Whether the way to a place goes on here, and does not begin again."""
        return False

    def way_back(
        self,
        anchor: Pose,  # noqa: ARG002
        pose: Pose,  # noqa: ARG002
        done: float,  # noqa: ARG002
        *,
        by_course: bool,  # noqa: ARG002
        is_car: bool,  # noqa: ARG002
    ) -> Pose | None:
        """The pose from which it goes on exactly; None: this one.

        A vehicle that is steered by course corrects its heading while it drives on, unless it is a
        car.
        """
        return None


def ramped(way: float, top: float, acceleration: float) -> float:
    """Return the seconds for a distance with equal ramps up and down."""
    if way * acceleration < top * top:
        return 2 * sqrt(way / acceleration)
    return way / top + top / acceleration


def is_turned(pose: Pose, other: Pose, most: float) -> bool:
    """Return whether two headings differ by more than ``most`` rad."""
    return abs(wrap(other.yaw - pose.yaw)) > most
