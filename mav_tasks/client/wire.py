"""Goals → commands and mission items, in the units and parameters of the dialect. Pure.

Move, Rotate and Drive are sent as commands with a nonce and task options. Any other goal is sent as
a plan whose TASK_OPTIONS item carries both. So a repeated submission is one task, and two equal
submissions are two tasks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, isfinite

from mav_tasks.kinds import Drive, Face, GlobalPlace, GoTo, LocalPlace, Move, Place, Rotate, Wait
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.mavlink.float_param import to_param
from mav_tasks.plan_files.values import PlanItem
from mav_tasks.services.missions import Item
from mav_tasks.tasks.repetition import canonical
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_NONCE, MAX_PRIORITY, MAX_TASK_ID

#: the goals that a client can submit; angles in radians
Goal = Move | Rotate | Drive | GoTo | Face | Wait
Command = m.CommandLong | m.CommandInt

#: the address of the task server itself, where it takes tasks for any of its rovers
SERVER = Address(250, 191)

LOCAL_SCALE = 1e4  # x and y in a local frame are in units of 0.1 mm
LARGEST = 0x7FFFFFFE  # largest x and y; INT32_MAX means "not given"
ON_THE_SPOT = 0.01  # m, acceptance radius if none is given
STOPPING = 0.01  # s, least hold time of a stop: a waypoint without hold is passed
NORTH = 360.0  # deg, sent for north: 0 would mean "no heading"
LEAST_YAW = 1e-4  # deg; a smaller yaw is sent as NORTH
#: numbers between these are float32s, also in degrees; others become 0 or infinite
LEAST, MOST = 1e-37, 1e36
EXACT = ("yaw", "north", "east")  # sent as integers, or else as NORTH
OWN_DEFAULT = -2.0  # DO_CHANGE_SPEED: the configured speed


@dataclass(frozen=True, slots=True)
class TaskOptions:
    """When and how a task runs; ``delay`` and ``deadline`` in seconds from now."""

    priority: int = DEFAULT_PRIORITY
    after: int = 0
    delay: float = 0.0
    deadline: float = 0.0

    def __post_init__(self) -> None:
        _whole("priority", self.priority, 0, MAX_PRIORITY)
        _whole("after", self.after, 0, MAX_TASK_ID)
        for name, value in (("delay", self.delay), ("deadline", self.deadline)):
            if not (isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} {value!r}: expected seconds, 0 or more")
            check_size(name, value)


def repeat_of(every: float | str) -> str:
    """Return the text of a repetition: seconds, or a cron expression; "" for 0 or "".

    Raise ValueError if it is invalid. A time zone is looked up here, too.
    """
    if isinstance(every, str):
        return canonical(every) if every else ""
    if isinstance(every, bool) or not isfinite(every) or every != int(every):
        raise ValueError(f"every {every!r}: expected whole seconds, or a cron expression")
    return canonical(f"{every:.0f}") if every else ""


def check_nonce(nonce: int) -> None:
    """Raise ValueError unless this is a nonce, or 0 for none."""
    _whole("nonce", nonce, 0, MAX_NONCE)


def check_check(check: int) -> None:
    """Raise ValueError unless this is a number that can accompany a nonce."""
    _whole("check", check, 0, LARGEST)


def command_of(
    goal: Move | Rotate | Drive, terms: TaskOptions, *, target: tuple[int, int], nonce: int
) -> m.CommandLong:
    """Return the command that submits a goal. The deadline is set afterwards."""
    own = _own(goal)
    options = to_param(nonce), to_param(terms.after), terms.delay, float(terms.priority)
    return m.CommandLong(*target, own[0], 0, *own[1:], *options)


def items_of_goals(goals: Sequence[Goal]) -> tuple[Item, ...]:
    """Return the items of a plan that drives the goals in order."""
    for goal in goals:
        if not isinstance(goal, Goal):
            raise ValueError(f"{goal!r}: expected a goal, such as Move(2.0)")
    return tuple(item for goal in goals for item in _items(goal))


def items_of_file(items: Sequence[PlanItem]) -> tuple[Item, ...]:
    """Return the items of a file as mission items."""
    return tuple(
        Item(i.frame, i.command, 0, int(i.autocontinue), *i.params, i.x, i.y, i.z) for i in items
    )


def file_items(items: Sequence[Item]) -> tuple[PlanItem, ...]:
    """Return downloaded items as items of a file: the inverse of ``items_of_file``."""
    return tuple(
        PlanItem(
            i.command,
            i.frame,
            (i.param1, i.param2, i.param3, i.param4),
            i.x,
            i.y,
            i.z,
            bool(i.autocontinue),
        )
        for i in items
    )


def with_home(items: Sequence[Item]) -> tuple[Item, ...]:
    """Return the items after a home item, as in ArduPilot; DO_JUMP targets move by one."""
    home = Item(MavFrame.GLOBAL, MavCmd.NAV_WAYPOINT, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
    moved = (
        item._replace(param1=item.param1 + 1) if item.command == MavCmd.DO_JUMP else item
        for item in items
    )
    return (home, *moved)


def options_of(terms: TaskOptions, *, nonce: int, check: int = 0) -> Item:
    """Return the TASK_OPTIONS item of a plan.

    It goes last, so that the targets of jumps stay right. The nonce tells this plan from an equal
    one, and lets the server recognize a late copy. A plan with this nonce and another ``check``
    is another plan, which the server refuses.
    """
    after, priority = to_param(terms.after), float(terms.priority)
    options = _item(MavCmd.TASK_OPTIONS, priority, terms.delay, terms.deadline, after)
    return options._replace(x=nonce, y=check)


def _own(goal: Move | Rotate | Drive) -> tuple[int, float, float, float]:
    match goal:
        case Move():
            _numbers(goal, distance=goal.distance, speed=goal.speed or 0.0)
            return MavCmd.TASK_MOVE, goal.distance, goal.speed or 0.0, 0.0
        case Rotate():
            _numbers(goal, angle=goal.angle, rate=goal.rate or 0.0)
            return MavCmd.TASK_ROTATE, degrees(goal.angle), degrees(goal.rate or 0.0), 0.0
        case _:
            _numbers(goal, forward=goal.forward, yaw_rate=goal.yaw_rate, duration=goal.duration)
            return MavCmd.TASK_DRIVE, goal.forward, degrees(goal.yaw_rate), goal.duration


def _items(goal: Goal) -> tuple[Item, ...]:
    match goal:
        case Move() | Rotate() | Drive():
            return (_item(*_own(goal), 0.0),)
        case Wait(duration=duration):
            _numbers(goal, duration=duration)
            return (_item(MavCmd.NAV_DELAY, duration, 0.0, 0.0, 0.0),)
        case Face(yaw=yaw, direction=direction, rate=rate):
            _numbers(goal, yaw=yaw, rate=rate or 0.0)
            heading, how = degrees(yaw) % 360.0, float(direction)
            return (_item(MavCmd.CONDITION_YAW, heading, degrees(rate or 0.0), how, 0.0),)
        case _:
            return _way(goal)


def _way(goal: GoTo) -> tuple[Item, ...]:
    _numbers(goal, wait=goal.wait, radius=goal.radius or 0.0, speed=goal.speed or 0.0)
    wait = goal.wait if goal.passes else max(goal.wait, STOPPING)
    yaw = 0.0
    if goal.yaw is not None:
        _numbers(goal, yaw=goal.yaw)
        yaw = degrees(goal.yaw) % 360.0
        yaw = NORTH if yaw < LEAST_YAW else yaw
    if goal.place is None:
        if goal.wait or goal.yaw is not None or goal.radius:
            raise ValueError(
                f"{goal}: a return home takes only a speed; add a Wait or Face after it"
            )
        way = _item(MavCmd.NAV_RETURN_TO_LAUNCH, 0.0, 0.0, 0.0, 0.0)
    else:
        frame, x, y = _at(goal.place)
        radius = goal.radius or (0.0 if goal.passes else ON_THE_SPOT)
        way = Item(frame, MavCmd.NAV_WAYPOINT, 0, 1, wait, radius, 0.0, yaw, x, y, 0.0)
    if goal.speed is None:
        return (way,)
    return _speed(goal.speed), way, _speed(OWN_DEFAULT)


def _at(place: Place) -> tuple[int, int, int]:
    if isinstance(place, GlobalPlace):
        return MavFrame.GLOBAL, place.latitude_degE7, place.longitude_degE7
    _numbers(place, north=place.north, east=place.east)
    x, y = round(place.north * LOCAL_SCALE), round(place.east * LOCAL_SCALE)
    if max(abs(x), abs(y)) > LARGEST:
        raise ValueError(f"{place}: too far away for a mission item")
    return MavFrame.LOCAL_NED, x, y


def _speed(speed: float) -> Item:
    return _item(MavCmd.DO_CHANGE_SPEED, 1.0, speed, -1.0, 0.0)


def _item(command: int, p1: float, p2: float, p3: float, p4: float) -> Item:
    return Item(MavFrame.MISSION, command, 0, 1, p1, p2, p3, p4, 0, 0, 0.0)


def _numbers(goal: Goal | LocalPlace, **values: float) -> None:
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ValueError(f"{goal}: {name} is not a number")
        if name not in EXACT:
            check_size(name, value)


def check_size(name: str, value: float) -> None:
    """Raise ValueError for a number that a float32 makes 0, which means "default", or infinite."""
    if value and not LEAST <= abs(value) <= MOST:
        raise ValueError(
            f"{name} {value:g} is too {'small' if abs(value) < 1 else 'large'} to send"
        )


def _whole(name: str, value: int, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{name} {value!r}: expected a whole number from {low} to {high}")
