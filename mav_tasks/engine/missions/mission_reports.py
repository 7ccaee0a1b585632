"""Reports mission progress to clients, and sends the mission's commands to the vehicle.

MISSION_CURRENT and MISSION_ITEM_REACHED go out in the name of the autopilot, because clients accept
them from no other component. The vehicle's own messages of the mission protocol are withheld: two
sources would contradict each other.
"""

from math import inf

from mav_tasks.config.settings import Settings
from mav_tasks.engine.missions.plan_items import performed
from mav_tasks.engine.missions.transfer import MissionParts
from mav_tasks.engine.services.missions import item_at
from mav_tasks.engine.timers import Turn
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.kinds import Act
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.enums import MavResult
from mav_tasks.mavlink.packet import Packet
from mav_tasks.tasks.events import (
    ActTold,
    Event,
    PlanStored,
    StepReached,
    TaskAdvanced,
    TaskChanged,
    VehicleNoted,
)
from mav_tasks.tasks.goal import Plan
from mav_tasks.tasks.lifecycle import TERMINAL
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import TaskId

INTERVAL = 1.0  # s, of MISSION_CURRENT
OVER = TERMINAL | {S.HELD}  # states in which no answer to an act counts any more
ENDS_TOLD = 5  # repeats of the last item's MISSION_ITEM_REACHED; PX4 sends 10
#: messages of the vehicle that are withheld while the server has its missions
REPLACED = {
    m.MissionAck.id,
    m.MissionCount.id,
    m.MissionCurrent.id,
    m.MissionItem.id,
    m.MissionItemInt.id,
    m.MissionItemReached.id,
    m.MissionRequest.id,
    m.MissionRequestInt.id,
}


class MissionReports:
    """The sender of mission progress to clients."""

    def __init__(self, parts: MissionParts, *, now: float) -> None:
        self._parts = parts
        self._next_at = now
        self._timer = parts.timers.timer(Turn.REPORTS, self._report)
        #: by vehicle: the last item that a mission reached, and how often it is told again
        self._last: dict[int, tuple[StepReached, int]] = {}
        self.apply(parts.settings)

    def apply(self, settings: Settings) -> None:
        self._claims = settings.claim
        self._timer.set(self._next_at if self._claims else inf)

    def forget(self, vehicle: int) -> None:
        """Forget a vehicle: its next gateway reports."""
        self._last.pop(vehicle, None)

    def replaces(self, packet: Packet) -> bool:
        """Whether a vehicle's packet is withheld, because the server reports on missions."""
        return self._claims and packet.message_id in REPLACED

    def publish(self, events: list[Event], *, now: float) -> None:
        """Report items reached and the current item; send the mission's commands to the vehicle."""
        changed: set[int] = set()
        for event in events:
            match event:
                case StepReached():
                    self._reached(event, now=now)
                    changed.add(event.vehicle)
                case ActTold():
                    self._act(event, now=now)
                case PlanStored():
                    changed.add(event.vehicle)
                case TaskChanged() | TaskAdvanced():
                    is_over = isinstance(event, TaskChanged) and event.new in OVER
                    if is_over and (vehicle := self._parts.vehicles.get(event.vehicle)):
                        vehicle.requests.drop_acts(event.task_id)
                    task = self._parts.registry.get(event.task_id)
                    if task is not None and isinstance(task.goal, Plan):
                        changed.add(event.vehicle)
        for system_id in changed:
            if vehicle := self._parts.vehicles.get(system_id):
                self._tell(vehicle, self._parts.plans.current(vehicle), now=now)

    def _report(self, *, now: float) -> None:
        self._next_at = now + INTERVAL
        self._timer.set(self._next_at)
        for vehicle in self._parts.vehicles.all:
            if not vehicle.is_heard(now=now):
                continue
            self._tell(vehicle, self._parts.plans.current(vehicle), now=now)
            # a client that missed the last item would never see the mission finished
            last, left = self._last.get(vehicle.system_id, (None, 0))
            task = self._parts.plans.shown(vehicle)
            if last and left and task and (task.id, task.state) == (last.task_id, S.COMPLETED):
                self._last[vehicle.system_id] = last, left - 1
                self._tell(vehicle, m.MissionItemReached(last.step))

    def _reached(self, event: StepReached, *, now: float) -> None:
        vehicle = self._parts.vehicles.get(event.vehicle)
        if vehicle is None:
            return
        self._tell(vehicle, m.MissionItemReached(event.step))
        self._last[event.vehicle] = event, ENDS_TOLD
        task = self._parts.registry.get(event.task_id) if event.performs else None
        if task is not None:
            assert isinstance(task.goal, Plan), "only plans have steps"
            item = item_at(task.goal.source, event.step)
            vehicle.perform(performed(item, Address(vehicle.system_id, AUTOPILOT)), now=now)

    def _act(self, event: ActTold, *, now: float) -> None:
        vehicle = self._parts.vehicles.get(event.vehicle)
        task = self._parts.registry.get(event.task_id)
        if vehicle is not None and task is not None and isinstance(task.goal, Plan):
            act = task.goal.steps[event.step]
            assert isinstance(act, Act), "only an act is told"
            vehicle.act((event.task_id, event.step), act, now=now)

    def tell_acted(self, vehicle: Vehicle, *, now: float) -> None:
        """Let a task that acts know the answer, and record in words one that is no yes."""
        for (task_id, step), answered in vehicle.requests.acted:
            ack = answered.ack
            accepted = None if ack is None else ack.result == MavResult.ACCEPTED
            is_noted = vehicle.tasks.executor.act_answered(
                TaskId(task_id), step, accepted, was_sent=answered.was_sent, now=now
            )
            if not is_noted or accepted or not answered.was_sent:
                continue
            words = f"did not answer command {answered.command} of task {task_id}"
            if ack is not None:
                result = _name_of(ack.result)
                words = f"refused command {answered.command} of task {task_id}: {result}"
                said = vehicle.parts.failsafes.said_since(vehicle.requests.told_at)
                words += f", {said}" if said else ""
            self._parts.registry.record(VehicleNoted(vehicle.system_id, words, now))
        vehicle.requests.acted.clear()

    def tell_unperformed(self, vehicle: Vehicle, *, now: float) -> None:
        """Record plan commands that the vehicle refused or did not answer; the plan goes on."""
        for answered in vehicle.requests.unperformed:
            ack, command = answered.ack, answered.command
            words = f"did not answer command {command} of the plan"
            if ack is not None:
                words = f"refused command {command} of the plan (result {ack.result})"
            self._parts.registry.record(VehicleNoted(vehicle.system_id, words, now))
        vehicle.requests.unperformed.clear()

    def _tell(self, vehicle: Vehicle, message: m.Message, *, now: float = inf) -> None:
        """Send a report to all clients but those that are to give up waiting for it ``now``."""
        source = Address(vehicle.system_id, AUTOPILOT)
        for client in self._parts.gcs.clients:
            if (
                now >= client.gives_up_at
                and client.is_heard
                and vehicle.system_id in client.introduced
            ):
                client.outlet.send(message, source)


def _name_of(result: int) -> str:
    known = result in {each.value for each in MavResult}
    return MavResult(result).name if known else f"result {result}"
