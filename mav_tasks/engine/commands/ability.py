"""Refuses or adapts goals that a vehicle cannot drive: its setpoints, steering, reach, fence."""

from typing import TypeVar

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Turning
from mav_tasks.engine.services.persona import Persona
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds import GoTo, SingleGoal
from mav_tasks.kinds.base import Ability
from mav_tasks.tasks.goal import Step
from mav_tasks.tasks.lifecycle import TaskReason

G = TypeVar("G", bound=Step)


def ability_of(persona: Persona, *, rover: str = "this rover") -> Ability:
    """Return how a vehicle moves; ``rover``: its name in refusals."""
    by_course = persona.turns_by_course
    return Ability(persona.honours_yaw_rate, persona.turning, rover, by_course)


def driven(goal: SingleGoal, persona: Persona, *, system_id: int) -> tuple[SingleGoal, str]:
    """Return a goal as this vehicle drives it, and a text if that differs, or "".

    Raise Rejection if it cannot drive it.
    """
    if persona.honours_yaw_rate and persona.turning is Turning.ON_SPOT:
        return goal, ""  # it drives everything
    return adapted(goal, ability_of(persona, rover=f"rover {system_id}"))


def adapted(goal: G, ability: Ability) -> tuple[G | SingleGoal, str]:
    """Return a goal, or step, as a vehicle of this ability drives it, and a text, as above."""
    if why := goal.why_not(ability):
        raise Rejection(TaskReason.NOT_SUPPORTED_BY_VEHICLE, why.words, param=why.param)
    as_driven: tuple[G | SingleGoal, str] = goal.as_driven(ability)
    return as_driven


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
