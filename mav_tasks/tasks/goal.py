"""The goals of tasks, as frozen values: one of a kind, or a plan of steps."""

from dataclasses import dataclass

from mav_tasks.kinds import GoTo, SingleGoal
from mav_tasks.kinds.base import Ability, Base, WhyNot

FEW_STEPS = 4  # most steps of a plan that may be told as a single goal


@dataclass(frozen=True, slots=True)
class Nothing(Base):
    """A step that does nothing: home, a take-off, or options of the whole plan."""


@dataclass(frozen=True, slots=True)
class SetSpeed(Base):
    """Drive at ``speed`` m/s from here on; None: as without a plan."""

    speed: float | None

    @property
    def named_speed(self) -> float:
        return self.speed or 0.0


@dataclass(frozen=True, slots=True)
class Jump(Base):
    """Continue at the step ``to``, ``times`` times (-1: for ever); after that do nothing."""

    to: int
    times: int


@dataclass(frozen=True, slots=True)
class SetReverse(Base):
    """Drive to the places from here on backwards, or forwards again."""

    backwards: bool

    def why_not(self, ability: Ability) -> WhyNot | None:
        if self.backwards and not ability.honours_yaw_rate:
            return WhyNot(f"{ability.why_no_reverse}: leave DO_SET_REVERSE out", 1)
        return None


@dataclass(frozen=True, slots=True)
class Perform(Base):
    """A command to the vehicle itself; only the plan's ``source`` says which one.

    ``role``: the least that may send it.
    """

    role: str = "operator"


@dataclass(frozen=True, slots=True)
class Delay(Base):
    """CONDITION_DELAY: the steps up to the next place wait ``seconds``; the vehicle drives on."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Near(Base):
    """CONDITION_DISTANCE: the steps up to the next place wait until it is ``distance`` m away."""

    distance: float


#: what is done on the way to the next place
OnTheWay = SetSpeed | Perform | Delay | Near
Step = SingleGoal | Nothing | SetReverse | Jump | OnTheWay


@dataclass(frozen=True, slots=True)
class Plan:
    """A mission: one step for each of its items, in order.

    ``source`` is the items as uploaded, for the code that sends and shows them; this package does
    not read it. ``first`` is the step at which the plan starts. ``has_home``: the first step is the
    home that ArduPilot puts before the file's items. ``has_options``: the last step is about the
    plan itself.
    """

    steps: tuple[Step, ...]
    source: str = ""
    first: int = 0
    has_home: bool = False
    has_options: bool = False

    @property
    def item_count(self) -> int:
        """Number of items in the plan's file, without home and options."""
        return len(self.steps) - self.has_home - self.has_options

    @property
    def words(self) -> str:
        """What it does: its only goal, if the other steps are its speed and options."""
        if len(self.steps) <= FEW_STEPS and not self.has_home:  # with home it is a mission
            unseen = Nothing | SetSpeed | SetReverse
            driven = [step for step in self.steps if not isinstance(step, unseen)]
            if len(driven) == 1 and isinstance(driven[0], SingleGoal):
                return driven[0].words
        count = self.item_count
        return f"plan of {count} item{'s' if count != 1 else ''}"

    def present_step(self, step: int) -> int:
        """Return the step of a progress; before the plan begins, the one at which it starts."""
        return self.first if step < 0 else step

    def item_number(self, step: int) -> int:
        """Return the number of a step's item in its file, from 1; 0 is home."""
        return number_of(step, has_home=self.has_home)


def number_of(step: int, *, has_home: bool) -> int:
    """Return the number of a step's item as the mission file counts, from 1.

    Home is 0 in the file. An upload has an item for home only if the autopilot keeps it there.
    """
    return step if has_home else step + 1


Goal = SingleGoal | Plan


def steps_of(goal: Goal) -> tuple[Step, ...]:
    """Return the steps of a goal; one that is no plan is its only step."""
    return goal.steps if isinstance(goal, Plan) else (goal,)


def ends_at_home(goal: Goal) -> bool:
    """Return whether the last place that a goal drives to is the vehicle's home."""
    driven = [step for step in steps_of(goal) if isinstance(step, SingleGoal)]
    return isinstance(driven[-1], GoTo) and driven[-1].place is None if driven else False
