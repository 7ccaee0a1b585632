"""Refuses goals whose places a vehicle must not drive to."""

from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.tasks.goal import GoTo
from mav_tasks.tasks.lifecycle import TaskReason

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
