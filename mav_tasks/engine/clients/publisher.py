"""Sends clients what they do not request each time: heartbeats, TASK_STATUS and texts.

A TASK_STATUS with a final state is sent once that state is durable, so that it is never taken back,
or after the time limit of the commit gate. A state that a client requests is sent at once.
"""

from functools import partial

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.clients.summary import next_words, summary_of
from mav_tasks.engine.clients.telemetry_rates import TelemetryRates
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.submissions import Submissions
from mav_tasks.engine.timers import Timers, Turn
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink.enums import MavSeverity, MavState
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.heartbeat import INTERVAL, component_heartbeat
from mav_tasks.tasks.events import (
    Event,
    QueueContinued,
    TaskAdvanced,
    TaskAssigned,
    TaskChanged,
    TaskModified,
    TaskSubmitted,
    TaskWaits,
)
from mav_tasks.tasks.lifecycle import TERMINAL
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import TaskId


class Publisher:
    """The sender of heartbeats, TASK_STATUS and texts to clients."""

    def __init__(
        self,
        gcs: GcsSide,
        vehicles: VehicleSide,
        registry: TaskRegistry,
        displays: MessageRequests,
        submissions: Submissions,
        rates: TelemetryRates,
        timers: Timers,
        *,
        now: float,
    ) -> None:
        self._gcs = gcs
        self._vehicles = vehicles
        self._registry = registry
        self._displays = displays
        self._submissions = submissions
        self._rates = rates
        self._ended: set[int] = set()  # tasks whose end is not durable yet
        timers.rhythm(Turn.HEARTBEATS, self._beat, period=INTERVAL, now=now)

    def welcome(self, client: GcsClient, *, now: float) -> None:
        """Send a client the latest heartbeat of each vehicle that it has not seen yet."""
        for vehicle in self._vehicles.all:
            if vehicle.system_id in client.introduced or not vehicle.is_heard(now=now):
                continue  # a silent vehicle must not look alive
            if vehicle.last_heartbeat is not None:
                heartbeat = vehicle.shown.applied(
                    vehicle.last_heartbeat, is_stopped=vehicle.tasks.is_stopped, now=now
                )
                client.introduce(heartbeat, last_seq=vehicle.last_seq)

    def withhold(self, packet: Packet) -> None:
        """Note for every client that a vehicle's packet is not forwarded: no gap shows."""
        for client in self._gcs.clients:
            client.outlet.withhold(packet.source)

    def publish(self, events: list[Event], *, now: float) -> None:
        """Send events as texts to all clients, and as TASK_STATUS to submitters and followers."""
        ended = {e.task_id for e in events if isinstance(e, TaskChanged) and e.new in TERMINAL}
        if ended:
            self._ended |= ended
            tell = partial(self._tell_ends, ended)
            self._submissions.gate.hold(tell, tell, now=now)
        for event in events:
            if isinstance(event, TaskSubmitted):
                if event.task.is_made:
                    self.note_change(event.task.id)
                continue  # ``Submissions`` and ``MissionUploads`` tell everybody of it
            spoken = translate.text_of(event)
            if spoken is not None:
                system_id, severity, text = spoken
                if vehicle := self._vehicles.get(system_id):
                    if isinstance(event, QueueContinued):
                        text += next_words(vehicle.tasks)
                    self._gcs.tell(text, severity, vehicle.server_address, now=now)
            if isinstance(
                event, TaskChanged | TaskModified | TaskAssigned | TaskAdvanced | TaskWaits
            ):
                self.note_change(event.task_id)

    def warn_of_store(self, *, now: float) -> None:
        """Tell all clients that the store has failed."""
        text = "Store failed: new tasks are refused. See the server's log"
        for vehicle in self._vehicles.all:
            self._gcs.tell(text, MavSeverity.ERROR, vehicle.server_address, now=now)

    def _tell_ends(self, ended: set[TaskId], *, now: float) -> None:
        self._ended -= ended
        for task_id in sorted(ended):
            self.note_change(task_id)
        self.send_statuses(now=now)

    def note_change(self, task_id: TaskId) -> None:
        """Schedule a TASK_STATUS to the submitter of a task, and to clients that follow it."""
        task = self._registry.get(task_id)
        if task is None or task_id in self._ended:
            return
        for client in self._gcs.clients:
            # a nonce proves it for good; after a restart or a long silence the client is a new one
            reads = client.uses_dialect or task.marks.nonce
            if (reads and client.submitted(task)) or client.follows(task.id):
                client.statuses.changed(task.id)

    def _awaits(self, client: GcsClient) -> bool:
        return self._registry.is_awaited_at(client.outlet.link, client.endpoint)

    def _beat(self, *, now: float) -> None:
        """Each second: heartbeats, message rates, dropped texts; forget silent clients."""
        self._gcs.forget_silent(awaits=self._awaits, now=now)
        self._rates.update(now=now)
        self._send_heartbeats(now=now)
        for client in self._gcs.clients:
            if client.left_out:
                client.tell_what_was_left_out(now=now)

    def send_statuses(self, *, now: float) -> None:
        """Send each client the statuses that are due."""
        for client in self._gcs.clients:
            if now < client.statuses.next_deadline():
                continue
            active: dict[int, int] = {
                vehicle.system_id: active_id
                for vehicle in self._vehicles.all
                if (active_id := vehicle.tasks.executor.task_id) is not None
            }
            for task_id in client.statuses.due(active, now=now):
                if task_id not in self._ended:
                    self._displays.push_status(client, task_id, now=now)
        self._gcs.plan_statuses()

    def _send_heartbeats(self, *, now: float) -> None:
        """Send the task server's heartbeat for each vehicle that is heard, to each client heard.

        A pushed address gets none before it answers. Its client must hear the autopilot first,
        because an older MAVSDK otherwise never connects.

        DEVIATION: the task server's component falls silent with its vehicle; its heartbeats would
        otherwise hide from a ground station that the vehicle is lost.
        """
        for vehicle in self._vehicles.all:
            if not vehicle.is_heard(now=now):
                continue
            active = vehicle.tasks.active is not None
            heartbeat = component_heartbeat(MavState.ACTIVE if active else MavState.STANDBY)
            source, new = vehicle.server_address, list[GcsClient]()
            for client in self._gcs.clients:
                if client.is_heard and vehicle.system_id in client.introduced:
                    client.outlet.send(heartbeat, source)
                    if client.is_to_be_informed(vehicle.system_id):
                        new.append(client)
            if new:
                self._inform(vehicle, new, now=now)

    def _inform(self, vehicle: Vehicle, new: list[GcsClient], *, now: float) -> None:
        """Tell clients that are new, or back, what is held or paused: with the next heartbeat.

        A ground station ignores texts of a vehicle that it has only just heard of.
        """
        words = summary_of(vehicle.tasks)
        for client in new if words else ():
            client.tell(words, MavSeverity.WARNING, vehicle.server_address, now=now)
