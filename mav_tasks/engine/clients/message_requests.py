"""Serves REQUEST_MESSAGE, the requests about message intervals, and SETUP_SIGNING.

SETUP_SIGNING makes the server sign its packets to a client, if the key is in the ring. It is never
forwarded: a rover whose key changed without the server would accept no STOP from it any more.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.basics.latest import keep_latest
from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.rights import SUBMITTER
from mav_tasks.engine.clients.signatures import Signatures
from mav_tasks.engine.clients.vehicle_view import STOPPED
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.services.commands import Command
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import EVERYBODY, Address, address_of
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.mavlink.special_values import FINISHED, PAGE
from mav_tasks.tasks.forecast import Forecast
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R = TaskReason

PROTOCOL_VERSION = m.ProtocolVersion(200, 100, 200, [0] * 8, [0] * 8)
MAX_FOLLOWED = 1000  # tasks that one client asked about and is told of
MAX_INTERVAL_ID = 0xFFFF  # of MESSAGE_INTERVAL.message_id


class _Reader(NamedTuple):
    """Who is sent messages about the tasks of one rover, and in whose name."""

    client: GcsClient
    address: Address
    tasks: VehicleTasks
    source: Address
    now: float


@dataclass(repr=False, eq=False)
class MessageRequests:
    """The handler of REQUEST_MESSAGE and of message intervals."""

    _gcs: GcsSide
    _vehicles: VehicleSide
    _signatures: Signatures
    _registry: TaskRegistry
    #: the name of this server in its fleet, "" if it is in none
    _gateway: str

    def set_interval(self, asked: CommandRequest, *, now: float) -> None:
        """SET_MESSAGE_INTERVAL: set this client's rate; ``TelemetryRates`` asks the rover."""
        client, vehicle, command = asked.client, asked.vehicle, asked.command
        message_id, interval_us = translate.message_id_of(command), command.params[1]
        if message_id < 0:
            raise Rejection(R.BAD_PARAMETER, f"param1 {command.params[0]:g} is not a message id")
        if not isfinite(interval_us):
            raise Rejection(R.BAD_PARAMETER, f"param2 interval {interval_us:g} is not finite")
        if message_id == m.TaskStatus.id:
            client.uses_dialect = True
            interval = interval_us / 1e6 if interval_us > 0 else None
            client.stream_statuses(vehicle.system_id, interval, now=now)
            return
        commands = asked.rights.reach(SUBMITTER)
        client.view(vehicle.system_id).wish(message_id, interval_us, commands=commands)

    def set_streams(self, client: GcsClient, message: m.RequestDataStream) -> None:
        """REQUEST_DATA_STREAM: set the interval of each message of the group."""
        rate = message.req_message_rate if message.start_stop else 0
        commands = client.rights.reach(SUBMITTER)
        for vehicle in self._vehicles.addressed_by(message.target_system):
            view = client.view(vehicle.system_id)
            view.wish_group(message.req_stream_id, rate, commands=commands)

    def set_up_signing(self, client: GcsClient, message: m.SetupSigning, *, now: float) -> None:
        """SETUP_SIGNING: a text says why not; QGroundControl looks for it, or signed packets."""
        for vehicle in self._vehicles.addressed_by(message.target_system)[:1]:
            why_not = "disabled by signing.setup"
            if vehicle.parts.settings.signing.setup == "known":
                why_not = self._signatures.set_up(*client.key, bytes(message.secret_key))
            if why_not:
                words = f"signing refused: {why_not}"
                client.tell(words, MavSeverity.ERROR, vehicle.server_address, now=now)

    def show_interval(self, asked: CommandRequest) -> None:
        """GET_MESSAGE_INTERVAL: send the interval at which this client gets a message."""
        message_id = translate.message_id_of(asked.command)
        if not 0 <= message_id <= MAX_INTERVAL_ID:
            words = f"param1 message id {asked.command.params[0]:g} not in 0..{MAX_INTERVAL_ID}"
            raise Rejection(R.BAD_PARAMETER, words)
        system_id = asked.vehicle.system_id
        if message_id == m.TaskStatus.id:
            seconds, _ = asked.client.status_streams.get(system_id, (STOPPED / 1e6, 0.0))
            interval = round(seconds * 1e6)
        else:
            interval = asked.client.view(system_id).interval_us(message_id)
        asked.client.outlet.send(m.MessageInterval(message_id, interval), asked.answering)

    def show(self, asked: CommandRequest, *, now: float) -> bool:
        """REQUEST_MESSAGE: send a message of the server itself. Return False if it is not one."""
        client, packet, command, vehicle = asked.client, asked.packet, asked.command, asked.vehicle
        match translate.message_id_of(command):
            case m.TaskStatus.id if task_id := translate.task_id_of(command):
                self.show_task(client, packet, task_id, now=now)
            case m.TaskTiming.id:
                client.uses_dialect = True
                self._show_timing(asked, now=now)
            case m.ProtocolVersion.id:
                client.outlet.send(PROTOCOL_VERSION, asked.answering)
            case _:
                place = vehicle.tasks, vehicle.server_address
                to = _Reader(client, packet.source, *place, now)
                return self._show(to, command, heard_at=vehicle.heard_at)
        return True

    def show_unheard(
        self,
        client: GcsClient,
        packet: Packet,
        command: Command,
        tasks: VehicleTasks,
        address: Address,
        *,
        now: float,
    ) -> bool:
        """REQUEST_MESSAGE about a rover not heard in this run. Return False if it is not for us."""
        message_id, task_id = translate.message_id_of(command), translate.task_id_of(command)
        to = _Reader(client, packet.source, tasks, address, now)
        client.uses_dialect = True
        if message_id == m.TaskTiming.id:  # needs the rover's setpoint rate
            words = self._vehicles.why_unheard(tasks.vehicle, now=now)
            raise Rejection(R.VEHICLE_SILENT, words)
        if message_id == m.TaskStatus.id and task_id:
            self._send(to, [self._task(task_id)])
            return True
        return self._show(to, command, heard_at=None)

    def show_task(self, client: GcsClient, packet: Packet, task_id: int, *, now: float) -> None:
        """Send a task's TASK_STATUS, and each later change; raise Rejection if there is no task."""
        client.uses_dialect = True
        task = self._task(task_id)
        keep_latest(client.followed, task_id, None, most=MAX_FOLLOWED)
        if owner := self._vehicles.look_at(task.vehicle):
            place = owner.tasks, owner.server_address
            self._send(_Reader(client, packet.source, *place, now), [task])

    def push_status(self, client: GcsClient, task_id: int, *, now: float) -> None:
        """Send a task's TASK_STATUS without its queue position, which takes time to compute."""
        task = self._registry.get(task_id)
        vehicle = None if task is None else self._vehicles.look_at(task.vehicle)
        if task is not None and vehicle is not None:
            submitter, reader = task.submitter, EVERYBODY
            if client.submitted(task):
                reader = address_of(submitter.system_id, submitter.component_id)
            number = self._gcs.link_numbers.get(submitter.link, 0)
            status = translate.task_status(
                task, vehicle.tasks, reader=reader, link_number=number, forecast=None, now=now
            )
            client.outlet.send(status, vehicle.server_address)

    def _task(self, task_id: int) -> Task:
        task = self._registry.get(task_id)
        if task is None:
            raise Rejection(R.NOT_FOUND, f"no task {task_id}")
        return task

    def _show(self, to: _Reader, command: Command, *, heard_at: float | None) -> bool:
        """Send a rover's queue, or a page of its tasks. Return False if neither is asked for."""
        registry, tasks = self._registry, to.tasks
        match translate.message_id_of(command):
            case m.TaskQueueStatus.id:
                status = translate.queue_status(
                    tasks,
                    registry.counts[tasks.vehicle],
                    heard_at=heard_at,
                    gateway=self._gateway.encode(),
                    version=registry.recorded,
                    now=to.now,
                )
                to.client.outlet.send(status, to.source)
            case m.TaskStatus.id:
                first = max(0, translate.whole_of(command.params[2]))
                ids = tasks.page(first, PAGE)
                if command.params[3] == FINISHED:
                    ids = registry.finished(tasks.vehicle, first, PAGE)
                self._send(to, [registry[each] for each in ids])
            case _:
                return False
        to.client.uses_dialect = True
        return True

    def _send(self, to: _Reader, shown: Iterable[Task]) -> None:
        """Send the TASK_STATUS of tasks, with their queue positions and estimated times."""
        forecast = Forecast(to.tasks, self._registry, now=to.now)
        for task in shown:
            number = self._gcs.link_numbers.get(task.submitter.link, 0)
            status = translate.task_status(
                task, to.tasks, reader=to.address, link_number=number, forecast=forecast, now=to.now
            )
            to.client.outlet.send(status, to.source)

    def _show_timing(self, asked: CommandRequest, *, now: float) -> None:
        task_id = translate.task_id_of(asked.command)
        task = self._registry.get(task_id) if task_id else asked.vehicle.tasks.active
        if task is None:
            words = f"no task {asked.command.params[1]:g}" if task_id else "no task runs"
            raise Rejection(R.NOT_FOUND, words)
        vehicle = self._vehicles.look_at(task.vehicle)
        if vehicle is None:  # its rover is of an earlier run, not heard yet: as for TASK_STATUS
            return
        period, reader = vehicle.parts.settings.watch.setpoint_period, asked.packet.source
        timing = vehicle.tasks.timing_of(task)
        message = translate.task_timing(task, timing, period=period, reader=reader, now=now)
        asked.client.outlet.send(message, vehicle.server_address)
