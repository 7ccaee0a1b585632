"""Fence and rally points go to the vehicle first, which keeps them where we cannot watch."""

from typing import Protocol

from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavMissionResult
from mav_tasks.services.mission_item import Item
from mav_tasks.tasks.lifecycle import TaskReason

R = TaskReason


class GoOn(Protocol):
    """What is done when the vehicle has it."""

    def __call__(self, *, now: float) -> None: ...


class Refuse(Protocol):
    """What is done when something is refused."""

    def __call__(self, refusal: Rejection, *, now: float) -> None: ...


class WriteThrough:
    """Writes plans to vehicles before they are stored here."""

    def __init__(self, vehicles: VehicleSide) -> None:
        self._vehicles = vehicles

    def write(
        self,
        vehicle: Vehicle,
        kind: int,
        items: tuple[Item, ...],
        go_on: GoOn,
        refuse: Refuse,
        *,
        now: float,
    ) -> None:
        """Go on once the vehicle has it; one that has no such thing may do without.

        What it refuses, or does not answer, changes nothing here.
        """

        def done(result: MavMissionResult | None, *, opaque_id: int, now: float) -> None:  # noqa: ARG001  # the vehicle's
            if result in (MavMissionResult.ACCEPTED, MavMissionResult.UNSUPPORTED):
                go_on(now=now)
            elif result is None:
                words = f"rover {vehicle.system_id} does not answer: not stored"
                refuse(Rejection(R.VEHICLE_SILENT, words), now=now)
            else:
                words = f"rover {vehicle.system_id} refuses it: {result.name}"
                refuse(Rejection(R.NOT_ALLOWED, words), now=now)

        vehicle.requests.write_plan(kind, items, done, now=now)
