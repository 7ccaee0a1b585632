"""How missions fare, told to clients: MISSION_CURRENT, MISSION_ITEM_REACHED; and what they order.

In the name of the autopilot, because clients listen to nobody else about missions. The vehicle's
own messages of the mission protocol are withheld meanwhile: two sources would contradict each
other.
"""

from mav_tasks.engine.gcs_side import GcsSide
from mav_tasks.engine.plan_items import performed
from mav_tasks.engine.plans import Plans
from mav_tasks.engine.vehicle import Vehicle
from mav_tasks.engine.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.packet import Packet
from mav_tasks.settings import Settings
from mav_tasks.tasks.book import TaskBook
from mav_tasks.tasks.events import (
    Event,
    PlanStored,
    StepReached,
    TaskAdvanced,
    TaskChanged,
)
from mav_tasks.tasks.goal import Plan

INTERVAL = 1.0  # s, of MISSION_CURRENT
#: of the vehicle, when the server has its missions
REPLACED = frozenset(
    {
        m.MissionAck.id,
        m.MissionCount.id,
        m.MissionCurrent.id,
        m.MissionItem.id,
        m.MissionItemInt.id,
        m.MissionItemReached.id,
        m.MissionRequest.id,
        m.MissionRequestInt.id,
    }
)


class MissionReports:
    """What clients are told of missions without asking."""

    def __init__(
        self, gcs: GcsSide, vehicles: VehicleSide, book: TaskBook, plans: Plans, settings: Settings
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._book = book
        self._plans = plans
        self._claims = settings.claim
        self._next_at = 0.0

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._claims = settings.claim

    def replaces(self, packet: Packet) -> bool:
        """Whether a vehicle's packet is not shown, because the server speaks of missions."""
        return self._claims and packet.message_id in REPLACED

    def publish(self, events: list[Event], *, now: float) -> None:
        """Tell of items that were reached, and of what is driven next; send what is ordered."""
        changed: set[int] = set()
        for event in events:
            match event:
                case StepReached():
                    self._reached(event, now=now)
                    changed.add(event.vehicle)
                case PlanStored():
                    changed.add(event.vehicle)
                case TaskChanged() | TaskAdvanced():
                    task = self._book.get(event.task_id)
                    if task is not None and isinstance(task.goal, Plan):
                        changed.add(event.vehicle)
        for system_id in changed:
            vehicle = self._vehicles.get(system_id)
            if vehicle is not None:
                self._tell(vehicle, self._plans.current(vehicle))

    def next_deadline(self) -> float | None:
        """Give when MISSION_CURRENT is due; None: there is nobody to tell of."""
        return self._next_at if self._claims and len(self._vehicles) else None

    def handle_deadline(self, *, now: float) -> None:
        """Send what is due."""
        if not self._claims or now < self._next_at:
            return
        self._next_at = now + INTERVAL
        for vehicle in self._vehicles:
            if vehicle.is_heard(now=now):
                self._tell(vehicle, self._plans.current(vehicle))

    def _reached(self, event: StepReached, *, now: float) -> None:
        vehicle = self._vehicles.get(event.vehicle)
        if vehicle is None:
            return
        self._tell(vehicle, m.MissionItemReached(event.step))
        task = self._book.get(event.task_id) if event.performs else None
        if task is not None:
            item = self._plans.item_of(task, event.step)
            vehicle.perform(performed(item, Address(vehicle.system_id, AUTOPILOT)), now=now)

    def _tell(self, vehicle: Vehicle, message: m.Message) -> None:
        source = Address(vehicle.system_id, AUTOPILOT)
        for client in self._gcs:
            if client.is_heard and client.knows(vehicle.system_id):
                client.outlet.send(message, source)
