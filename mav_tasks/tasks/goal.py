"""The goals of tasks, as frozen values. SI units and radians; angles clockwise from north."""

from dataclasses import dataclass
from math import degrees


@dataclass(frozen=True, slots=True)
class Move:
    """Drive straight along the heading at the start.

    ``distance`` in metres, negative = backwards; ``speed`` in m/s, positive, None = default.
    """

    distance: float
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class MoveTurned:
    """Move backwards with a vehicle that cannot reverse: turn round, drive, turn back.

    ``distance`` in metres, positive; ``speed`` as in Move.
    """

    distance: float
    speed: float | None = None


@dataclass(frozen=True, slots=True)
class Rotate:
    """Turn on the spot: ``angle`` in radians, clockwise positive, may exceed a full turn.

    ``rate`` in rad/s, positive, None = default.
    """

    angle: float
    rate: float | None = None


@dataclass(frozen=True, slots=True)
class Drive:
    """Keep a velocity for a time: m/s forward, rad/s clockwise, ``duration`` in seconds."""

    forward: float
    yaw_rate: float
    duration: float


@dataclass(frozen=True, slots=True)
class LocalPlace:
    """A place in the vehicle's own local frame, metres north and east of its origin."""

    north: float
    east: float


@dataclass(frozen=True, slots=True)
class GlobalPlace:
    """A place on earth, exactly as MAVLink's integers give it."""

    latitude_degE7: int
    longitude_degE7: int


Place = LocalPlace | GlobalPlace


@dataclass(frozen=True, slots=True)
class GoTo:
    """Drive to a place in a straight line, facing forward.

    ``place`` None is the vehicle's home. ``speed`` in m/s, None = default. ``radius`` is the
    acceptance radius in metres, None = the tolerance of a move. ``yaw`` is the heading in radians
    to turn to on arrival, None = any. ``wait`` is the seconds to stand there. ``passes``: in a
    plan, the vehicle does not stop at the place if another one follows. With ``turns`` it drives
    that many turns round the place instead, ``around`` metres from it, negative =
    counter-clockwise. ``backwards``: it drives there backwards.
    """

    place: Place | None
    speed: float | None = None
    radius: float | None = None
    yaw: float | None = None
    wait: float = 0.0
    passes: bool = False
    turns: float = 0.0
    around: float = 0.0
    backwards: bool = False


@dataclass(frozen=True, slots=True)
class Face:
    """Turn on the spot to a heading.

    ``yaw`` in radians from north; ``direction`` 1 clockwise, -1 counter-clockwise, 0 the shorter
    way; ``rate`` in rad/s, None = default.
    """

    yaw: float
    direction: int = 0
    rate: float | None = None


@dataclass(frozen=True, slots=True)
class Head:
    """Drive towards a heading for a time: ``yaw`` in radians, ``forward`` in m/s.

    ``is_relative``: the yaw counts from the heading at the start.
    """

    yaw: float
    forward: float
    duration: float
    is_relative: bool = False


@dataclass(frozen=True, slots=True)
class Wait:
    """Stand for ``duration`` seconds.

    With ``until`` it stands until that time of day (UTC), and ``duration`` is when it comes again:
    hour, minute and second, of which the first ones may be -1 = any.
    """

    duration: float
    until: tuple[int, ...] = ()


#: a goal that drives on its own: a task's goal, or a step of a plan
SingleGoal = Move | MoveTurned | Rotate | Drive | GoTo | Face | Head | Wait


@dataclass(frozen=True, slots=True)
class Nothing:
    """A step that does nothing: home, a take-off, or options of the whole plan."""


@dataclass(frozen=True, slots=True)
class SetSpeed:
    """Drive at ``speed`` m/s from here on; None: as without a plan."""

    speed: float | None


@dataclass(frozen=True, slots=True)
class Jump:
    """Continue at the step ``to``, ``times`` times (-1: for ever); after that do nothing."""

    to: int
    times: int


@dataclass(frozen=True, slots=True)
class SetReverse:
    """Drive to the places from here on backwards, or forwards again."""

    backwards: bool


@dataclass(frozen=True, slots=True)
class Perform:
    """A command to the vehicle itself; only the plan's ``source`` says which one.

    ``role``: the least that may send it.
    """

    role: str = "operator"


@dataclass(frozen=True, slots=True)
class Delay:
    """CONDITION_DELAY: the steps up to the next place wait ``seconds``; the vehicle drives on."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Near:
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

    def item_number(self, step: int) -> int:
        """Return the number of a step's item in its file, from 1; 0 is home."""
        return number_of(step, has_home=self.has_home)


def number_of(step: int, *, has_home: bool) -> int:
    """Return the number of a step's item as the mission file counts, from 1.

    Home is 0 in the file. An upload has an item for home only if the autopilot keeps it there.
    """
    return step if has_home else step + 1


Goal = SingleGoal | Plan

FEW_STEPS = 4  # most steps of a plan that may be described as a single goal


def describe(goal: Goal) -> str:
    """Return a goal as text, in the units of its command."""
    if isinstance(goal, GoTo):
        return _describe_way(goal.place)
    if isinstance(goal, Plan):
        return _describe_plan(goal)
    match goal:
        case Move(distance=distance):
            return f"move {distance:g} m"
        case MoveTurned(distance=distance):
            return f"move {-distance:g} m"
        case Rotate(angle=angle):
            return f"rotate {degrees(angle):.6g} deg"
        case Drive(forward=forward, duration=duration):
            return f"drive {forward:g} m/s for {duration:g} s"
        case Face(yaw=yaw):
            return f"face {degrees(yaw) % 360:.6g} deg"
        case Head(forward=forward, duration=duration):
            return f"drive {forward:g} m/s on a heading for {duration:g} s"
        case Wait(until=until) if until:
            return f"wait until {':'.join(f'{part:02}' for part in until)} UTC"
        case Wait(duration=duration):
            return f"wait {duration:g} s"


def kind_of(goal: SingleGoal) -> str:
    """Return a goal's kind as the rules of roles name it: one of ``TASK_KINDS`` in the settings."""
    match goal:
        case Move() | MoveTurned():
            return "move"
        case Rotate() | Face():
            return "rotate"
        case Drive() | Head():
            return "drive"
        case GoTo(place=None):
            return "return"
        case GoTo():
            return "goto"
        case Wait():
            return "wait"


def speed_named_by(step: Step) -> float:
    """Return the speed that a step names, m/s; 0 if it names none."""
    match step:
        case Move(speed=speed) | MoveTurned(speed=speed) | GoTo(speed=speed):
            return speed or 0.0
        case SetSpeed(speed=speed):
            return speed or 0.0
        case Drive(forward=forward) | Head(forward=forward):
            return abs(forward)
        case _:
            return 0.0


def steps_of(goal: Goal) -> tuple[Step, ...]:
    """Return the steps of a goal; one that is no plan is its only step."""
    return goal.steps if isinstance(goal, Plan) else (goal,)


def ends_at_home(goal: Goal) -> bool:
    """Return whether the last place that a goal drives to is the vehicle's home."""
    driven = [step for step in steps_of(goal) if isinstance(step, SingleGoal)]
    return isinstance(driven[-1], GoTo) and driven[-1].place is None if driven else False


def _describe_plan(plan: Plan) -> str:
    if len(plan.steps) <= FEW_STEPS and not plan.has_home:  # with home it is a mission
        unseen = Nothing | SetSpeed | SetReverse
        driven = [step for step in plan.steps if not isinstance(step, unseen)]
        if len(driven) == 1 and isinstance(driven[0], SingleGoal):
            return describe(driven[0])  # the other steps are its speed and options
    count = plan.item_count
    return f"plan of {count} item{'s' if count != 1 else ''}"


def _describe_way(place: Place | None) -> str:
    match place:
        case None:
            return "return home"
        case LocalPlace(north=north, east=east):
            return f"go to {north:.2f} m N, {east:.2f} m E"
        case GlobalPlace(latitude_degE7=latitude, longitude_degE7=longitude):
            return f"go to {latitude / 1e7:.6f}, {longitude / 1e7:.6f}"
