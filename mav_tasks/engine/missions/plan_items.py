"""Parses mission items into a plan; a Rejection names the bad item. Pure functions.

An item means the same as the command of its number (``goals``). Here is what only plans have:
places to pass without stopping, jumps, conditions, and commands that the vehicle itself executes.
"""

from collections.abc import Callable, Sequence
from math import inf, isnan
from typing import NamedTuple

from mav_tasks.engine.commands.ability import Ability, as_driven
from mav_tasks.engine.commands.goals import (
    GOALS,
    KNOWN_FRAMES,
    MAX_DELAY,
    MAX_WAIT,
    MIN_SPEED,
    bad,
    goal_of,
    identifier,
    number,
    refuse_infinite,
    whole,
)
from mav_tasks.engine.policy import is_task_command
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame, MavMissionResult
from mav_tasks.services.command_receiver import NO_MESSAGE, Command
from mav_tasks.services.mission_item import NOT_GIVEN, Item, packed
from mav_tasks.services.persona import Persona
from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.mission_sequencer import loops_in_vain
from mav_tasks.tasks.goal import (
    Delay,
    GoTo,
    Jump,
    Near,
    Nothing,
    Perform,
    Plan,
    SetSpeed,
    SingleGoal,
    Step,
    Wait,
    number_of,
)
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_NONCE, MAX_PRIORITY, Terms

R = TaskReason

FOR_EVER = 1e9  # s; JSON has no infinity
MAX_JUMPS = 65_535
NO_CHANGE, DEFAULT = -1.0, -2.0  # DO_CHANGE_SPEED, param2
GROUND_OR_AIR = 1  # the same, highest param1: airspeed counts as ground speed
NOBODY = Address(0, 0)
HERE = (0, NOT_GIVEN)  # values of x and y that mean no place

#: commands that the vehicle executes: cameras, gimbals, servos, relays, its home
PERFORMED = frozenset(
    {
        MavCmd.DO_SET_HOME,
        *(181, 182, 183, 184, 187),  # relays, servos, actuators
        *(195, 197, 201, 202, 203, 204, 205, 206),  # regions of interest, cameras, mounts
        *(530, 531, 532, 1000, 1001),  # camera modes, zoom, focus, gimbals
        *(2000, 2001, 2003, 2500, 2501),  # pictures and videos
    }
)

#: mission result by refusal reason; a bad parameter has a result of its own
RESULT_OF: dict[int, MavMissionResult] = {
    R.BAD_PARAMETER: MavMissionResult.INVALID,
    R.VEHICLE_SILENT: MavMissionResult.ERROR,
    R.STORE_UNAVAILABLE: MavMissionResult.ERROR,
    R.BAD_FRAME: MavMissionResult.UNSUPPORTED_FRAME,
    R.NOT_SUPPORTED_BY_VEHICLE: MavMissionResult.UNSUPPORTED,
}


class MissionParseOptions(NamedTuple):
    """How items are parsed: the vehicle's conventions, and the server's limits."""

    has_home: bool  # item 0 is home, as with ArduPilot
    ability: Ability
    driving: Driving

    @classmethod
    def of(cls, persona: Persona, *, is_staged: bool, driving: Driving) -> "MissionParseOptions":
        """Return the options of a vehicle; ``is_staged``: the plan is for the autopilot."""
        return cls(persona.has_home_item and is_staged, Ability.of(persona), driving)


class ParsedMission(NamedTuple):
    """A plan, with the terms and the nonce (or 0) of its options item."""

    plan: Plan
    terms: Terms
    nonce: int = 0


def result_of(refusal: Rejection) -> MavMissionResult:
    """Return the MAV_MISSION_RESULT of a refusal."""
    if refusal.param:
        return MavMissionResult(MavMissionResult.INVALID_PARAM1 + refusal.param - 1)
    return RESULT_OF.get(refusal.reason, MavMissionResult.DENIED)


def step_of(item: Item, seq: int, *, count: int, manner: MissionParseOptions) -> Step:
    """Return the step of an item. Raise Rejection that names the item's number in the file."""
    if manner.has_home and seq == 0:
        return Nothing()
    name = number_of(seq, has_home=manner.has_home)
    try:
        step = _step_of(item, count=count, driving=manner.driving)
    except Rejection as why:
        raise Rejection(why.reason, f"item {name}: {why.text}", param=why.param) from None
    if isinstance(step, SingleGoal):
        return as_driven(step, manner.ability)
    return step


def _step_of(item: Item, *, count: int, driving: Driving) -> Step:
    command = _command_of(item)
    if item.frame not in KNOWN_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {item.frame} is unknown")
    refuse_infinite(command)
    kind = _STEPS.get(item.command)
    if kind is not None:
        return kind(command, count, driving)
    if item.command in PERFORMED:
        return Perform()
    if is_task_command(item.command) and item.command in GOALS:
        return _own(command, driving)
    if item.command in GOALS and item.command != MavCmd.DO_REPOSITION:
        return goal_of(command, driving)
    words = f"command {item.command} is not supported in a plan"
    raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)


def steps_of(items: Sequence[Item], *, manner: MissionParseOptions) -> tuple[Step, ...]:
    """Return the steps of all items of a plan."""
    return tuple(
        step_of(item, seq, count=len(items), manner=manner) for seq, item in enumerate(items)
    )


def plan_of(
    items: Sequence[Item], steps: tuple[Step, ...], *, has_home: bool, now: float
) -> ParsedMission:
    """Return the plan of items and their steps. Raise Rejection if they make no plan."""
    has_options = bool(items) and items[-1].command == MavCmd.TASK_OPTIONS
    plan = Plan(steps, packed(items), has_home=has_home, has_options=has_options)
    loop = loops_in_vain(plan)
    if loop is not None:
        raise Rejection(R.BAD_PARAMETER, f"item {plan.item_number(loop)}: a loop without motion")
    options = next((item for item in reversed(items) if item.command == MavCmd.TASK_OPTIONS), None)
    if options is None:
        return ParsedMission(plan, Terms())
    nonce = options.x if 0 < options.x <= MAX_NONCE else 0  # 0: it has no valid one
    return ParsedMission(plan, _options(_command_of(options), now=now), nonce)


def performed(item: Item, target: Address) -> m.CommandLong | m.CommandInt:
    """Return the command of an item that the vehicle executes."""
    first = (item.param1, item.param2, item.param3, item.param4)
    p1, p2, p3, p4, p7 = map(_given, (*first, item.z))
    x, y = item.x, item.y
    if item.frame == MavFrame.MISSION:
        return m.CommandLong(*target, item.command, 0, p1, p2, p3, p4, float(x), float(y), p7)
    return m.CommandInt(*target, item.frame, item.command, 0, 0, p1, p2, p3, p4, x, y, p7)


def _given(value: float) -> float:
    """Return a number for the vehicle: 0 for NaN, which makes some autopilots abort."""
    return 0.0 if isnan(value) else value


def _command_of(item: Item) -> Command:
    first = (item.param1, item.param2, item.param3, item.param4)
    params = (*first, float(item.x), float(item.y), item.z)
    return Command(NOBODY, item.command, params, 0, item.frame, NO_MESSAGE)


def _options(command: Command, *, now: float) -> Terms:
    delay = number(command, 2, "start delay", low=0.0, high=MAX_DELAY, default=0.0)
    deadline = number(command, 3, "deadline", low=0.0, high=MAX_DELAY, default=0.0)
    return Terms(
        priority=whole(command, 1, "priority", high=MAX_PRIORITY, default=DEFAULT_PRIORITY),
        after=identifier(command, 4, "run after"),
        start_at=now + delay if delay else None,
        deadline=now + deadline if deadline else None,
    )


# steps


def _waypoint(command: Command, _count: int, driving: Driving) -> Step:
    goal = goal_of(command, driving)
    assert isinstance(goal, GoTo), "a waypoint is a place"
    if goal.wait or goal.yaw is not None:
        return goal
    return GoTo(goal.place, goal.speed, goal.radius, passes=True)


def _loiter(command: Command, _count: int, driving: Driving) -> Step:
    if all(part in HERE for part in command.params[4:6]):
        return Wait(FOR_EVER)
    goal = goal_of(command._replace(command=MavCmd.NAV_WAYPOINT), driving)
    assert isinstance(goal, GoTo), "a waypoint is a place"
    return GoTo(goal.place, wait=FOR_EVER)


def _nothing(_command: Command, _count: int, _driving: Driving) -> Step:
    return Nothing()


def _take_options(command: Command, _count: int, _driving: Driving) -> Step:
    _options(command, now=0.0)  # only to check them
    return Nothing()


def _delay(command: Command, _count: int, _driving: Driving) -> Step:
    return Delay(number(command, 1, "delay", low=0.0, high=MAX_WAIT))


def _near(command: Command, _count: int, driving: Driving) -> Step:
    return Near(number(command, 1, "distance", low=0.0, high=driving.max_distance))


def _jump(command: Command, count: int, _driving: Driving) -> Step:
    to = whole(command, 1, "item", high=count - 1, default=None)
    return Jump(to, whole(command, 2, "repeat", low=-1, high=MAX_JUMPS, default=None))


def _go_on_with(command: Command, count: int, _driving: Driving) -> Step:
    return Jump(whole(command, 1, "item", high=count - 1, default=None), -1)


def _speed(command: Command, _count: int, driving: Driving) -> Step:
    whole(command, 1, "speed type", high=GROUND_OR_AIR)
    wish = command.params[1]
    if wish == NO_CHANGE or isnan(wish):
        return Nothing()
    if wish == DEFAULT:
        return SetSpeed(None)
    # planners leave speeds of aircraft there: bound them to the limit
    return SetSpeed(min(number(command, 2, "speed", low=MIN_SPEED, high=inf), driving.max_speed))


def _own(command: Command, driving: Driving) -> Step:
    for index, name in ((5, "run after"), (6, "start delay")):
        if command.params[index - 1] not in HERE:
            raise bad(f"param{index} {name}: not in a plan item, use TASK_OPTIONS", param=index)
    return goal_of(command, driving)


_STEPS: dict[int, Callable[[Command, int, Driving], Step]] = {
    MavCmd.NAV_WAYPOINT: _waypoint,
    MavCmd.NAV_LOITER_UNLIM: _loiter,
    MavCmd.NAV_TAKEOFF: _nothing,
    MavCmd.CONDITION_DELAY: _delay,
    MavCmd.CONDITION_DISTANCE: _near,
    MavCmd.DO_JUMP: _jump,
    MavCmd.DO_CHANGE_SPEED: _speed,
    MavCmd.DO_SET_MISSION_CURRENT: _go_on_with,
    MavCmd.TASK_OPTIONS: _take_options,
}
