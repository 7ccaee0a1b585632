"""Writes fence and rally points to the vehicle first, which enforces them without the server."""

from mav_tasks.engine.commands.dependency_questions import Refuse
from mav_tasks.engine.timers import Effect
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item
from mav_tasks.tasks.lifecycle import TaskReason

R = TaskReason


def write_through(
    vehicle: Vehicle,
    kind: int,
    items: tuple[Item, ...],
    go_on: Effect,
    refuse: Refuse,
    *,
    now: float,
) -> None:
    """Write a plan to the vehicle, then call ``go_on``, also if it does not support the plan.

    If the vehicle refuses it or does not answer, call ``refuse``: nothing is stored then.
    """

    def done(result: MavMissionResult | None, *, opaque_id: int, now: float) -> None:  # noqa: ARG001  # the vehicle's
        if result in (MavMissionResult.ACCEPTED, MavMissionResult.UNSUPPORTED):
            go_on(now=now)
        elif result is None:
            words = f"rover {vehicle.system_id} did not answer: not stored"
            refuse(Rejection(R.VEHICLE_SILENT, words), now=now)
        else:
            words = f"rover {vehicle.system_id} refused it: {result.name}"
            refuse(Rejection(R.NOT_ALLOWED, words), now=now)

    vehicle.requests.write_plan(kind, items, done, now=now)
