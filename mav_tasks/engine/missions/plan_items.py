"""Parses mission, fence and rally items; a Rejection names the bad item. Pure functions.

``plan_table`` says what becomes of a mission item; here is what the whole plan adds to that.

MAVLink common.xml, MAV_CMD_NAV_FENCE_*: a polygon's corners are consecutive items, and param1 of
each is their number. A return point is kept for the vehicle and not used here. A circle of radius 0
means "no circle": MAVSDK's programs send it so.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot, isnan
from typing import Any, NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.commands.ability import adapted
from mav_tasks.engine.missions.plan_table import (
    SKIPPED,
    MissionParseOptions,
    act_of,
    name_of,
    options_of,
    row_of_item,
    step_of_command,
)
from mav_tasks.engine.services.commands import NO_MESSAGE, Command
from mav_tasks.engine.services.missions import Item, packed, unpacked
from mav_tasks.kinds import GlobalPlace, GoTo, Place
from mav_tasks.kinds.params import GLOBAL_FRAMES, KNOWN_FRAMES, bad, place_in, refuse_infinite
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame, MavMissionResult
from mav_tasks.tasks.driving.fence import Circle, Fence, Polygon, Zone, check
from mav_tasks.tasks.driving.frames import local_place
from mav_tasks.tasks.driving.mission_sequencer import loops_in_vain
from mav_tasks.tasks.goal import Goal, Jump, Near, Nothing, Perform, Plan, Step, number_of
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import MAX_NONCE, Terms

R = TaskReason

MAX_LATITUDE, MAX_LONGITUDE = 900_000_000, 1_800_000_000  # degE7
MAX_RADIUS = 1e6  # m
MAX_GROUP = 255
#: whether a zone is an inclusion, by command
CORNERS: dict[int, bool] = {
    MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
CIRCLES: dict[int, bool] = {
    MavCmd.NAV_FENCE_CIRCLE_INCLUSION: True,
    MavCmd.NAV_FENCE_CIRCLE_EXCLUSION: False,
}
OF_FENCE = (*CORNERS, *CIRCLES, MavCmd.NAV_FENCE_RETURN_POINT)


def check_fence_item(item: Item, seq: int, *, count: int) -> None:
    """Raise Rejection if an item of a fence with ``count`` items is bad."""
    name, value = f"item {seq + 1}", item.param1
    _check_command(item, name, OF_FENCE, "a fence")
    place_of(item)
    if item.command in CORNERS and not (3 <= value <= count and value == int(value)):
        words = f"{name}: param1 {value:g} corners: not a whole number in 3..{count}"
        raise bad(words, param=1)
    if item.command in CIRCLES and not 0.0 <= value <= MAX_RADIUS:
        raise bad(f"{name}: param1 radius {value:g} m not in 0..{MAX_RADIUS:g}", param=1)
    group = item.param2
    if group == group and not (0 <= group <= MAX_GROUP and group == int(group)):
        raise bad(f"{name}: param2 group {group:g} not in 0..{MAX_GROUP}", param=2)


def check_rally_item(item: Item, seq: int) -> None:
    """Raise Rejection if a rally point is bad."""
    _check_command(item, f"item {seq + 1}", (MavCmd.NAV_RALLY_POINT,), "rally points")
    place_of(item)


def fence_of(items: Sequence[Item]) -> Fence:
    """Return the fence of checked items. Raise Rejection if they make no valid fence."""
    zones: list[Zone] = []
    seq = 0
    while seq < len(items):
        item, number = items[seq], 1
        code, size = item.command, item.param1
        group = 0 if item.param2 != item.param2 else int(item.param2)  # NaN: not given
        if code in CORNERS:
            number = int(size)
            corners = items[seq : seq + number]
            if [(each.command, each.param1) for each in corners] != [(code, size)] * number:
                words = f"item {seq + 1}: polygon of {number} corners is incomplete or mixed"
                raise Rejection(R.BAD_PARAMETER, words)
            zones.append(Polygon(tuple(map(place_of, corners)), CORNERS[code], group))
        elif code in CIRCLES and not _is_no_circle(item):
            zones.append(Circle(place_of(item), size, CIRCLES[code], group))
        seq += number
    fence = Fence(tuple(zones))
    wrong = check(fence)
    if wrong:
        raise Rejection(R.BAD_PARAMETER, wrong)
    return fence


def fence_for_vehicle(items: Sequence[Item]) -> tuple[Item, ...]:
    """Return the fence items to send to a vehicle: autopilots refuse circles of radius 0."""
    return tuple(item for item in items if not _is_no_circle(item))


def _is_no_circle(item: Item) -> bool:
    return item.command in CIRCLES and item.param1 == 0.0


def place_of(item: Item) -> GlobalPlace:
    if item.frame not in GLOBAL_FRAMES:
        raise Rejection(R.BAD_FRAME, f"frame {item.frame} is not supported here")
    if abs(item.x) > MAX_LATITUDE:
        raise bad(f"x latitude {item.x / 1e7:.7f} not in -90..90", param=5)
    if abs(item.y) > MAX_LONGITUDE:
        raise bad(f"y longitude {item.y / 1e7:.7f} not in -180..180", param=6)
    return GlobalPlace(item.x, item.y)


def _check_command(item: Item, name: str, commands: Sequence[int], what: str) -> None:
    if item.command not in commands:
        words = f"{name}: command {item.command} is not supported in {what}"
        raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)


TAG, JUMP_TAG, GATE = 600, 601, 4501
NOBODY = Address(0, 0)

#: mission result by refusal reason; a bad parameter has a result of its own
RESULT_OF: dict[int, MavMissionResult] = {
    R.BAD_PARAMETER: MavMissionResult.INVALID,
    R.VEHICLE_SILENT: MavMissionResult.ERROR,
    R.STORE_UNAVAILABLE: MavMissionResult.ERROR,
    R.BAD_FRAME: MavMissionResult.UNSUPPORTED_FRAME,
    R.NOT_SUPPORTED_BY_VEHICLE: MavMissionResult.UNSUPPORTED,
}


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
    command = _command_of(item)
    try:
        if item.frame not in KNOWN_FRAMES:
            raise Rejection(R.BAD_FRAME, f"frame {item.frame} is unknown")
        refuse_infinite(command)
        return adapted(step_of_command(command, count, manner), manner.ability)[0]
    except Rejection as why:
        name = number_of(seq, has_home=manner.has_home)
        raise Rejection(why.reason, f"item {name}: {why.text}", param=why.param) from None


def steps_of(items: Sequence[Item], *, count: int, manner: MissionParseOptions) -> list[Step]:
    """Return the steps of the first items of a plan of ``count``."""
    return [step_of(item, seq, count=count, manner=manner) for seq, item in enumerate(items)]


def plan_of(
    items: Sequence[Item], steps: Sequence[Step], *, has_home: bool, now: float
) -> ParsedMission:
    """Return the plan of items and their steps. Raise Rejection if they make no plan."""
    has_options = bool(items) and items[-1].command == MavCmd.TASK_OPTIONS
    plan = Plan(
        tuple(_resolved(items, steps)), packed(items), has_home=has_home, has_options=has_options
    )
    loop = loops_in_vain(plan)
    if loop is not None:
        raise Rejection(R.BAD_PARAMETER, f"item {plan.item_number(loop)}: a loop without motion")
    options = next((item for item in reversed(items) if item.command == MavCmd.TASK_OPTIONS), None)
    if options is None:
        return ParsedMission(plan, Terms())
    nonce = options.x if 0 < options.x <= MAX_NONCE else 0  # 0: it has no valid one
    return ParsedMission(plan, options_of(_command_of(options), now=now), nonce)


def _resolved(items: Sequence[Item], steps: Sequence[Step]) -> Iterator[Step]:
    """Yield the steps with what only the whole plan says: where a tag is, the place before."""
    acts = [item.command == MavCmd.TASK_ACT for item in items]
    tags = [item.param1 if item.command == TAG else None for item in items]
    places = [step.place if isinstance(step, GoTo) else None for step in steps]
    for seq, (item, step) in enumerate(zip(items, steps, strict=True)):
        if item.command == JUMP_TAG and isinstance(step, Jump):
            # as on an ArduPilot a tag that is nowhere is the end
            yield replace(step, to=[*tags, item.param1].index(item.param1))
        elif item.command == GATE:
            after = [place for place in places[seq:] if place]
            yield Near(_apart(place_in(_command_of(item)), after[0])) if after else Nothing()
        elif isinstance(step, GoTo) and step.turns and not step.place:
            before = [place for place in places[:seq] if place]
            yield replace(step, place=before[-1]) if before else Nothing()
        elif acts[seq] and not (seq + 1 < len(steps) and isinstance(steps[seq + 1], Perform)):
            words = f"item {seq + 1}: TASK_ACT is about the next item, which is sent to no rover"
            raise Rejection(R.BAD_PARAMETER, words)
        elif seq and acts[seq - 1]:
            yield act_of(_command_of(items[seq - 1]), _command_of(item))
        else:
            yield step


def _apart(one: Place | None, other: Place) -> float:
    origin = other if isinstance(other, GlobalPlace) else None
    here, there = local_place(one, origin), local_place(other, origin)
    return hypot(here.north - there.north, here.east - there.east) if here and there else 0.0


def performed(item: Item, target: Address) -> m.CommandLong | m.CommandInt:
    """Return the command of an item that the vehicle executes."""
    # 0 for NaN, which makes some autopilots abort
    params: list[Any] = [0.0 if isnan(value) else value for value in item.params]
    if item.frame == MavFrame.MISSION:
        return m.CommandLong(*target, item.command, 0, *params)
    return m.CommandInt(*target, item.frame, item.command, 0, 0, *params)


def _command_of(item: Item) -> Command:
    return Command(NOBODY, item.command, item.params, 0, item.frame, NO_MESSAGE)


def skipped(plan: Goal) -> str:
    """Return what a plan skips, as the end of a text."""
    assert isinstance(plan, Plan), "only that has items"
    skips = [
        f"{plan.item_number(seq)} ({name_of(item.command)})"
        for seq, item in enumerate(unpacked(plan.source))
        if row_of_item(item.command).use == SKIPPED and plan.steps[seq] == Nothing()
    ]
    return f"; it skips item {', '.join(skips)}" if skips else ""
