"""Parses commands into goals, terms and deduplication keys. Pure functions.

Takes our own commands, and the standard ones of clients that do not know this server. A Rejection
names the bad parameter.
"""

from collections.abc import Callable
from functools import cache
from hashlib import blake2b
from math import degrees, inf, isinf, isnan, nan, radians, tau
from struct import Struct

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Driving
from mav_tasks.engine.policy import TASK_COMMANDS
from mav_tasks.engine.services.commands import Command
from mav_tasks.kinds import (
    Drive,
    Face,
    GlobalPlace,
    GoTo,
    Head,
    LocalPlace,
    Move,
    Place,
    Rotate,
    SingleGoal,
    Wait,
)
from mav_tasks.kinds.wait import DAY, HOUR, MINUTE
from mav_tasks.mavlink.enums import MavCmd, MavFrame
from mav_tasks.mavlink.float_param import EXACT, large_number
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_PRIORITY, MAX_TASK_ID, Marks, Terms

R = TaskReason

#: a COMMAND_INT without coordinates may name any existing frame
KNOWN_FRAMES = frozenset(MavFrame)
GLOBAL_FRAMES = frozenset(frame for frame in MavFrame if frame.name.startswith("GLOBAL"))
NOT_GIVEN = 0x7FFFFFFF  # x and y of COMMAND_INT, whose integers have no NaN
LOCAL_SCALE = 1e4  # COMMAND_INT's x and y in a local frame are metres times this
MAX_WAIT = 86_400.0  # s
MAX_DELAY = 31_536_000.0  # s, a year
CHANGE_MODE, RELATIVE_YAW = 1, 2  # MAV_DO_REPOSITION_FLAGS
MAX_FLAGS = EXACT  # of a bit mask in a float32
MIN_SPEED = 0.01  # m/s; a slower drive takes minutes for a metre, and counts as stuck
MIN_RATE = 0.1  # deg/s, the same for turning
HEAD_FOR = 3.0  # s that NAV_SET_YAW_SPEED drives: an autopilot's own setpoint time-out

INTEGERS = (5, 6)  # x and y of COMMAND_INT

_MARK = Struct("<BBHh7d")


def parse_command(
    command: Command,
    packet: bytes,
    driving: Driving,
    *,
    now: float,
    priority: int = DEFAULT_PRIORITY,
    is_cruising: bool = False,
) -> tuple[SingleGoal, Terms, Marks]:
    """Return a task command's goal and terms, and the keys by which a repeat is recognised.

    Raise Rejection that names a bad parameter.

    ``priority`` and ``is_cruising`` are for standard commands, which cannot name them.
    """
    if command.frame is not None and command.frame not in KNOWN_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {command.frame} is unknown")
    goal = GOALS[command.command](command, driving)
    if command.command not in TASK_COMMANDS:
        refuse_infinite(command)
        terms = _terms(priority, is_cruising=is_cruising)
        return goal, terms, marks_of(command, packet)
    marks = marks_of(command, packet, nonce=identifier(command, 4, "nonce"))
    after, delay = 0, 0.0
    if any(command.params[4:6]):
        after = identifier(command, 5, "run after")
        delay = number(command, 6, "start delay", low=0.0, high=MAX_DELAY, default=0.0)
    named = whole(command, 7, "priority", high=MAX_PRIORITY, default=DEFAULT_PRIORITY)
    start_at = now + delay if delay > 0 else None
    if after or start_at is not None:
        return goal, Terms(priority=named, after=after, start_at=start_at), marks
    return goal, _terms(named), marks


@cache  # nearly all are equal, and making them takes time
def _terms(priority: int, *, is_cruising: bool = False) -> Terms:
    return Terms(priority=priority, is_cruising=is_cruising)


def goal_of(command: Command, driving: Driving) -> SingleGoal:
    """Return the goal of a task command. Raise Rejection that names a bad parameter."""
    return GOALS[command.command](command, driving)


def marks_of(command: Command, packet: bytes, *, nonce: int = 0) -> Marks:
    """Return the keys by which a repeated submission is recognised; NaN is equal to NaN.

    With a nonce the packet's digest is not needed.
    """
    params: tuple[float, ...] = command.params
    if isnan(sum(params)):  # at least one: NaN has many forms
        params = tuple(nan if isnan(p) else p for p in params)
    frame = -1 if command.frame is None else command.frame
    packed = _MARK.pack(*command.target, command.command, frame, *params)
    payload = blake2b(packed, digest_size=9).hexdigest()
    whole_packet = "" if nonce else blake2b(packet, digest_size=9).hexdigest()
    return Marks(nonce, payload, whole_packet)


# numbers


def bad(words: str, *, param: int) -> Rejection:
    """Return a Rejection for a parameter, 1 to 7."""
    return Rejection(R.BAD_PARAMETER, words, param=param)


def number(
    command: Command,
    index: int,
    name: str,
    *,
    low: float,
    high: float,
    default: float | None = None,
) -> float:
    """Return a parameter, or raise Rejection that names it. NaN is "not given"."""
    value = command.params[index - 1]
    if low <= value <= high:
        return value
    label = f"param{index} {name}"
    if not isnan(value):
        raise bad(f"{label} {value:.8g} not in {low:.8g}..{high:.8g}", param=index)
    if default is None:
        raise bad(f"{label} is not given", param=index)
    return default


def whole(
    command: Command, index: int, name: str, *, high: int, low: int = 0, default: int | None = 0
) -> int:
    """Return a whole-number parameter, or raise Rejection that names it.

    ``default`` None: it must be given.
    """
    value = command.params[index - 1]
    if low <= value <= high and value == int(value):
        return int(value)
    fallback = None if default is None else float(default)
    value = number(command, index, name, low=low, high=high, default=fallback)
    if value != int(value):
        raise bad(f"param{index} {name} {value:.8g} is not a whole number", param=index)
    return int(value)


def identifier(
    command: Command, index: int, name: str, *, low: int = 0, default: int | None = 0
) -> int:
    """Return a task id or nonce, a whole number that may exceed the range of a float32."""
    value = command.params[index - 1]
    if low <= value <= EXACT and value == int(value):
        return int(value)
    is_integer = command.frame is not None and index in INTEGERS
    large = None if is_integer else large_number(value)
    if large is not None:
        return large
    high = MAX_TASK_ID if is_integer else EXACT
    return whole(command, index, name, low=low, high=high, default=default)


def flag(command: Command, index: int, name: str, *, default: int | None = 0) -> bool:
    """Return a parameter that is 0 or 1."""
    return whole(command, index, name, high=1, default=default) == 1


def has_place(command: Command) -> bool:
    """Whether x and y give a place, valid or not."""
    x, y = command.params[4:6]
    if command.frame is None:
        return not (isnan(x) and isnan(y))
    return not x == y == NOT_GIVEN


def place_in(command: Command) -> Place | None:
    """Return the place in x and y, or None if none is given. Raise Rejection if it is bad."""
    if not has_place(command):
        return None
    x, y = command.params[4:6]
    if command.frame is None:
        latitude = number(command, 5, "latitude", low=-90.0, high=90.0)
        longitude = number(command, 6, "longitude", low=-180.0, high=180.0)
        return _global(round(latitude * 1e7), round(longitude * 1e7))
    for value, name, param in ((x, "x", 5), (y, "y", 6)):
        if value == NOT_GIVEN:
            raise bad(f"{name} is not given", param=param)
    if command.frame == MavFrame.LOCAL_NED:
        return LocalPlace(x / LOCAL_SCALE, y / LOCAL_SCALE)
    if command.frame not in GLOBAL_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {command.frame} is not supported here")
    if abs(x) > 90e7:
        raise bad(f"x latitude {x / 1e7:.7f} not in -90..90", param=5)
    if abs(y) > 180e7:
        raise bad(f"y longitude {y / 1e7:.7f} not in -180..180", param=6)
    return _global(int(x), int(y))


def _global(latitude_degE7: int, longitude_degE7: int) -> GlobalPlace:
    if latitude_degE7 == longitude_degE7 == 0:  # an unset place looks like this
        raise bad("latitude and longitude are 0: no place is given", param=5)
    return GlobalPlace(latitude_degE7, longitude_degE7)


def _place(command: Command) -> Place:
    place = place_in(command)
    if place is None:
        raise bad("param5 latitude, param6 longitude: not given", param=5)
    return place


def _yaw(command: Command, index: int, *, turn: float) -> float | None:
    """Return a heading of at most a full ``turn``, None if none is given.

    0 counts as none: many clients leave a 0 there without meaning north.
    """
    return number(command, index, "yaw", low=-turn, high=turn, default=0.0) or None


def _speed_or_default(command: Command, index: int, driving: Driving) -> float | None:
    """Return a speed in m/s, None for the default: 0 or NaN."""
    value = command.params[index - 1]
    if value == 0.0 or isnan(value):
        return None
    return number(command, index, "speed", low=MIN_SPEED, high=driving.max_speed)


def _rate_or_default(command: Command, index: int, driving: Driving) -> float | None:
    """Return a turn rate in rad/s, None for the default: 0 or NaN."""
    value = command.params[index - 1]
    if value == 0.0 or isnan(value):
        return None
    fastest = degrees(driving.max_turn_rate)
    return radians(number(command, index, "rate", low=MIN_RATE, high=fastest))


# goals


def _move(command: Command, driving: Driving) -> SingleGoal:
    longest = driving.max_distance
    distance = number(command, 1, "distance", low=-longest, high=longest)
    speed = _speed_or_default(command, 2, driving)
    _refuse_reserved(command, 3)
    if distance == 0.0:
        raise bad("param1 distance is 0: nothing to do", param=1)
    return Move(distance, speed)


def _rotate(command: Command, driving: Driving) -> SingleGoal:
    turn = degrees(driving.max_turn)
    angle = number(command, 1, "angle", low=-turn, high=turn)
    rate = _rate_or_default(command, 2, driving)
    _refuse_reserved(command, 3)
    if angle == 0.0:
        raise bad("param1 angle is 0: nothing to do", param=1)
    return Rotate(radians(angle), rate)


def _drive(command: Command, driving: Driving) -> SingleGoal:
    top, fastest = driving.max_speed, degrees(driving.max_turn_rate)
    forward = number(command, 1, "forward speed", low=-top, high=top, default=0.0)
    rate = number(command, 2, "yaw rate", low=-fastest, high=fastest, default=0.0)
    duration = number(command, 3, "duration", low=0.0, high=driving.max_duration)
    if duration == 0.0:
        raise bad("param3 duration is 0: nothing to do", param=3)
    if forward == rate == 0.0:
        raise bad("param1 speed and param2 rate are 0: nothing to do", param=1)
    return Drive(forward, radians(rate), duration)


def refuse_infinite(command: Command) -> None:
    """Raise Rejection for an infinite parameter, also an unused one: it cannot be meant."""
    for index, value in enumerate(command.params, 1):
        if isinf(value):
            raise bad(f"param{index} is infinite", param=index)


def _refuse_reserved(command: Command, index: int) -> None:
    """Raise Rejection if a reserved parameter is set: it must not be ignored silently."""
    value = command.params[index - 1]
    if value != 0.0 and not isnan(value):
        raise bad(f"param{index} (unused): must be 0 in this version", param=index)


def _waypoint(command: Command, _driving: Driving) -> SingleGoal:
    hold = number(command, 1, "hold", low=0.0, high=MAX_WAIT, default=0.0)
    radius = number(command, 2, "acceptance radius", low=0.0, high=1000.0, default=0.0)
    yaw = _yaw(command, 4, turn=360.0)  # degrees; DO_REPOSITION's is in radians
    return GoTo(_place(command), None, radius or None, yaw and radians(yaw), hold)


def reposition_flags(command: Command) -> int:
    """Return the MAV_DO_REPOSITION_FLAGS of a "go to"."""
    return whole(command, 2, "flags", high=MAX_FLAGS)


def _reposition(command: Command, driving: Driving) -> SingleGoal:
    speed = None if command.params[0] == -1.0 else _speed_or_default(command, 1, driving)
    radius = number(command, 3, "radius", low=-inf, high=1000.0, default=0.0)
    yaw = _yaw(command, 4, turn=tau)
    if yaw is not None and reposition_flags(command) & RELATIVE_YAW:
        raise bad("param2 relative yaw is not supported, give the heading from north", param=2)
    return GoTo(_place(command), speed, max(radius, 0.0) or None, yaw)


def _loiter_time(command: Command, _driving: Driving) -> SingleGoal:
    seconds = number(command, 1, "time", low=0.0, high=MAX_WAIT)
    here = tuple(command.params[4:6]) == (0.0, 0.0) or place_in(command) is None
    return Wait(seconds) if here else GoTo(_place(command), wait=seconds)


def _return(_command: Command, _driving: Driving) -> SingleGoal:
    return GoTo(None)


def _delay(command: Command, _driving: Driving) -> SingleGoal:
    wish = command.params[0]
    if wish < 0.0 or (wish == 0.0 and any(command.params[1:4])):
        return _time_of_day(command)
    return Wait(number(command, 1, "delay", low=0.0, high=MAX_WAIT))


def _time_of_day(command: Command) -> SingleGoal:
    until = tuple(
        whole(command, index, name, low=-1, high=high, default=-1)
        for index, name, high in ((2, "hour", 23), (3, "minute", 59), (4, "second", 59))
    )
    again = [period for part, period in zip(until, (DAY, HOUR, MINUTE), strict=True) if part >= 0]
    return Wait(again[0], until) if again else Wait(0.0)


def _condition_yaw(command: Command, driving: Driving) -> SingleGoal:
    angle = number(command, 1, "angle", low=-360.0, high=360.0)
    rate = _rate_or_default(command, 2, driving)
    direction = whole(command, 3, "direction", low=-1, high=1)
    if not flag(command, 4, "relative"):
        return Face(radians(angle), direction, rate)
    if angle == 0.0:
        raise bad("param1 angle is 0: nothing to do", param=1)
    return Rotate(radians(angle if direction >= 0 else -angle), rate)


def _set_yaw_speed(command: Command, driving: Driving) -> SingleGoal:
    angle = number(command, 1, "angle", low=-360.0, high=360.0)
    top = driving.max_speed
    speed = number(command, 2, "speed", low=-top, high=top)
    return Head(radians(angle), speed, HEAD_FOR, is_relative=flag(command, 3, "relative"))


#: parser of the goal, by command
GOALS: dict[int, Callable[[Command, Driving], SingleGoal]] = {
    MavCmd.TASK_MOVE: _move,
    MavCmd.TASK_ROTATE: _rotate,
    MavCmd.TASK_DRIVE: _drive,
    MavCmd.NAV_WAYPOINT: _waypoint,
    MavCmd.NAV_LOITER_TIME: _loiter_time,
    MavCmd.NAV_RETURN_TO_LAUNCH: _return,
    MavCmd.NAV_DELAY: _delay,
    MavCmd.CONDITION_YAW: _condition_yaw,
    MavCmd.DO_REPOSITION: _reposition,
    MavCmd.NAV_SET_YAW_SPEED: _set_yaw_speed,
}
