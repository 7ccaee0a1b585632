"""Parses mission items into a plan; a Rejection names the bad item. Pure functions.

``plan_table`` says what becomes of an item; here is what the whole plan adds to that.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import hypot, isnan
from typing import Any, NamedTuple

from mav_tasks.engine.commands.ability import as_driven
from mav_tasks.engine.commands.goals import KNOWN_FRAMES, place_in, refuse_infinite
from mav_tasks.engine.missions.plan_table import (
    SKIPPED,
    MissionParseOptions,
    name_of,
    options_of,
    row_of_item,
    step_of_command,
)
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavCmd, MavFrame, MavMissionResult
from mav_tasks.services.command_receiver import NO_MESSAGE, Command
from mav_tasks.services.mission_item import Item, packed, unpacked
from mav_tasks.tasks.driving.mission_sequencer import loops_in_vain
from mav_tasks.tasks.frames import local_place
from mav_tasks.tasks.goal import (
    GlobalPlace,
    Goal,
    GoTo,
    Jump,
    Near,
    Nothing,
    Place,
    Plan,
    Step,
    number_of,
)
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import MAX_NONCE, Terms

R = TaskReason

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
        return as_driven(step_of_command(command, count, manner), manner.ability)
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
