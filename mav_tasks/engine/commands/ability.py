"""Refuses or adapts goals that a vehicle cannot drive: its setpoints, steering, reach, fence."""

from dataclasses import replace
from typing import NamedTuple, TypeVar

from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.kinds import Drive, Face, GoTo, Head, Move, MoveTurned, Rotate, SingleGoal
from mav_tasks.services.persona import Persona
from mav_tasks.settings import Turning
from mav_tasks.tasks.goal import SetReverse, Step
from mav_tasks.tasks.lifecycle import TaskReason


class Ability(NamedTuple):
    """How a vehicle moves; ``rover`` is its name in refusals."""

    honours_yaw_rate: bool = True
    turning: Turning = Turning.ON_SPOT
    rover: str = "this rover"
    turns_by_course: bool = False  # turns on the spot to the course of a setpoint

    @classmethod
    def of(cls, persona: Persona, *, rover: str = "this rover") -> "Ability":
        return cls(persona.honours_yaw_rate, persona.turning, rover, persona.turns_by_course)

    @property
    def turns_on_spot(self) -> bool:
        """Whether the vehicle turns while it stands."""
        return (self.honours_yaw_rate and self.turning is Turning.ON_SPOT) or self.turns_by_course

    @property
    def why_no_turn(self) -> str:
        """Text: why it does not turn while it stands."""
        if self.turning is Turning.STEERED:
            return f"{self.rover} steers like a car and cannot turn on the spot"
        return f"{self.rover} can neither turn on the spot nor follow a yaw rate"

    @property
    def why_no_rate(self) -> str:
        """Text: why it does not turn at a rate."""
        if self.turning is Turning.STEERED:
            return f"{self.rover} is steered by course and cannot follow a yaw rate"
        return self.why_no_turn

    @property
    def why_no_reverse(self) -> str:
        """Text: why it does not reverse."""
        return f"{self.rover} cannot reverse"


G = TypeVar("G", bound=Step)


def driven(goal: SingleGoal, persona: Persona, *, system_id: int) -> tuple[SingleGoal, str]:
    """Return a goal as this vehicle drives it, and a text if that differs, or "".

    Raise Rejection if it cannot drive it.
    """
    if persona.honours_yaw_rate and persona.turning is Turning.ON_SPOT:
        return goal, ""  # it drives everything
    ability = Ability.of(persona, rover=f"rover {system_id}")
    return as_driven(goal, ability), driven_otherwise(goal, ability)


def as_driven(goal: G, ability: Ability) -> G | SingleGoal:
    """Return a goal, or step, as a vehicle of this ability drives it. Raise Rejection if it cannot.

    The final heading of a "go to" is dropped where the autopilot ignores it, too: clients name one
    without meaning it.
    """
    if isinstance(goal, GoTo):
        turns = ability.honours_yaw_rate and ability.turning is Turning.ON_SPOT
        return goal if turns or goal.yaw is None else replace(goal, yaw=None)
    if _turns_round(goal, ability):
        assert isinstance(goal, Move)
        return MoveTurned(-goal.distance, goal.speed)
    if goal == SetReverse(backwards=True) and not ability.honours_yaw_rate:
        raise _cannot(f"{ability.why_no_reverse}: leave DO_SET_REVERSE out", param=1)
    if ability.turning is Turning.STEERED:
        _check_rolls(goal, ability)
    if not ability.honours_yaw_rate:
        _check_course(goal, ability)
    return goal


def _turns_round(goal: Step, ability: Ability) -> bool:
    """Whether a backward move is driven forwards, between two turns on the spot."""
    is_backwards = isinstance(goal, Move) and goal.distance < 0
    return is_backwards and not ability.honours_yaw_rate and ability.turns_on_spot


def driven_otherwise(wish: SingleGoal, ability: Ability) -> str:
    """Return a text on how a goal is driven differently than requested, or ""."""
    if _turns_round(wish, ability):
        return f"{ability.why_no_reverse}: it turns round, drives, turns back"
    if ability.turning is not Turning.STEERED or not isinstance(wish, GoTo) or wish.yaw is None:
        return ""
    return f"{ability.rover} steers like a car: the final heading is ignored"


def _check_rolls(goal: Step, ability: Ability) -> None:
    """Raise Rejection for a turn in place: a car turns only while it rolls."""
    match goal:
        case Rotate() | Face():
            raise _cannot(ability.why_no_turn)
        case Drive(forward=0.0, yaw_rate=yaw_rate) if yaw_rate:
            raise _cannot(f"param2 yaw rate: {ability.why_no_turn}", param=2)
        case Head(forward=0.0):
            raise _cannot(f"param2 speed 0: {ability.why_no_turn}", param=2)


def _check_course(goal: Step, ability: Ability) -> None:
    """Raise Rejection for a turn rate or reverse: setpoints of speed and course have neither."""
    match goal:
        case Rotate() | Face() if not ability.turns_on_spot:
            raise _cannot(ability.why_no_turn)
        case Move(distance=distance) if distance < 0:
            raise _cannot(f"param1 distance {distance:g}: {ability.why_no_reverse}", param=1)
        case Drive(forward=forward) if forward < 0:
            raise _cannot(f"param1 forward speed {forward:g}: {ability.why_no_reverse}", param=1)
        case Drive(yaw_rate=yaw_rate) if yaw_rate:
            raise _cannot(f"param2 yaw rate: {ability.why_no_rate}", param=2)
        case Head(forward=forward) if forward < 0:
            raise _cannot(f"param2 speed {forward:g}: {ability.why_no_reverse}", param=2)
        case Head(forward=0.0) if not ability.turns_on_spot:
            raise _cannot(f"param2 speed 0: {ability.why_no_turn}", param=2)


def _cannot(words: str, *, param: int = 0) -> Rejection:
    return Rejection(TaskReason.NOT_SUPPORTED_BY_VEHICLE, words, param=param)


R = TaskReason


def check_reach(vehicle: Vehicle, goal: GoTo, *, name: str = "the place", param: int = 0) -> None:
    """Raise Rejection for a place too far away, by a typing error, or outside the fence.

    ``name`` and ``param``: what it calls the place, and the number of its parameter.
    """
    far = vehicle.where.distance_to(goal)
    longest = vehicle.parts.settings.driving.max_distance
    if far is not None and far > longest:
        words = f"{name} is {far / 1000:.1f} km away, more than {longest / 1000:g} km"
        raise Rejection(R.BAD_PARAMETER, words, param=param)
    if not vehicle.where.is_within_fence(goal):
        raise Rejection(R.OUTSIDE_FENCE, f"{name} is outside the fence")
