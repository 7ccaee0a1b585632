"""Serves REQUEST_MESSAGE and the requests about message intervals."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.clients.gcs_side import GcsSide
from mav_tasks.engine.clients.rights import SUBMITTER
from mav_tasks.engine.clients.vehicle_view import STOPPED
from mav_tasks.engine.commands import translate
from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.errors import Rejection
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address, address_of
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import Command
from mav_tasks.tasks.forecast import Forecast
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Task
from mav_tasks.tasks.vehicle_tasks import VehicleTasks

R = TaskReason

PROTOCOL_VERSION = m.ProtocolVersion(200, 100, 200, [0] * 8, [0] * 8)
EVERYBODY = Address(0, 0)
PAGE = 16  # waiting or finished tasks that one request returns
MAX_INTERVAL_ID = 0xFFFF  # of MESSAGE_INTERVAL.message_id


@dataclass(repr=False, eq=False)
class MessageRequests:
    """The handler of REQUEST_MESSAGE and of message intervals."""

    _gcs: GcsSide
    _vehicles: VehicleSide
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

    def show_interval(self, asked: CommandRequest) -> None:
        """GET_MESSAGE_INTERVAL: send the interval at which this client gets a message."""
        message_id = translate.message_id_of(asked.command)
        if not 0 <= message_id <= MAX_INTERVAL_ID:
            words = f"param1 message id {asked.command.params[0]:g} not in 0..{MAX_INTERVAL_ID}"
            raise Rejection(R.BAD_PARAMETER, words)
        system_id = asked.vehicle.system_id
        if message_id == m.TaskStatus.id:
            seconds = asked.client.status_interval(system_id)
            interval = STOPPED if seconds is None else round(seconds * 1e6)
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
                place, heard_at = (vehicle.tasks, vehicle.server_address), vehicle.heard_at
                return self._show(client, packet, command, *place, heard_at=heard_at, now=now)
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
        client.uses_dialect = True
        if message_id == m.TaskTiming.id:  # needs the rover's setpoint rate
            raise Rejection(R.VEHICLE_SILENT, f"no heartbeat from rover {tasks.vehicle} yet")
        if message_id == m.TaskStatus.id and task_id:
            self._send(client, [self._task(task_id)], tasks, address, packet.source, now=now)
            return True
        return self._show(client, packet, command, tasks, address, heard_at=None, now=now)

    def show_task(self, client: GcsClient, packet: Packet, task_id: int, *, now: float) -> None:
        """Send a task's TASK_STATUS, and each later change; raise Rejection if there is no task."""
        client.uses_dialect = True
        task = self._task(task_id)
        client.follow(task_id)
        if owner := self._vehicles.look_at(task.vehicle):
            place = owner.tasks, owner.server_address
            self._send(client, [task], *place, packet.source, now=now)

    def push_status(self, client: GcsClient, task_id: int, *, now: float) -> None:
        """Send a task's TASK_STATUS without its queue position, which takes time to compute."""
        task = self._registry.get(task_id)
        vehicle = None if task is None else self._vehicles.look_at(task.vehicle)
        if task is not None and vehicle is not None:
            to = task.submitter.system_id, task.submitter.component_id
            reader = address_of(*to) if client.submitted(task) else EVERYBODY
            tasks, address = vehicle.tasks, vehicle.server_address
            self._send_one(client, task, tasks, address, reader, forecast=None, now=now)

    def _task(self, task_id: int) -> Task:
        task = self._registry.get(task_id)
        if task is None:
            raise Rejection(R.NOT_FOUND, f"no task {task_id}")
        return task

    def _show(
        self,
        client: GcsClient,
        packet: Packet,
        command: Command,
        tasks: VehicleTasks,
        address: Address,
        *,
        heard_at: float | None,
        now: float,
    ) -> bool:
        """Send a rover's queue, or the first of its tasks. Return False if neither is asked for."""
        match translate.message_id_of(command):
            case m.TaskQueueStatus.id:
                status = translate.queue_status(
                    tasks,
                    self._registry.counts(tasks.vehicle),
                    heard_at=heard_at,
                    gateway=self._gateway.encode(),
                    version=self._registry.recorded,
                    now=now,
                )
                client.outlet.send(status, address)
            case m.TaskStatus.id:  # waiting or finished ones
                first = max(0, translate.first_index_of(command))
                is_of_finished = translate.is_of_finished(command)
                ids = (
                    self._registry.finished(tasks.vehicle, first, PAGE)
                    if is_of_finished
                    else tasks.page(first, PAGE)
                )
                shown = [self._registry[each] for each in ids]
                self._send(client, shown, tasks, address, packet.source, now=now)
            case _:
                return False
        client.uses_dialect = True
        return True

    def _send(
        self,
        client: GcsClient,
        shown: Iterable[Task],
        tasks: VehicleTasks,
        address: Address,
        reader: Address,
        *,
        now: float,
    ) -> None:
        """Send the TASK_STATUS of tasks, with their queue positions and estimated times."""
        forecast = Forecast(tasks, self._registry, now=now)
        for task in shown:
            self._send_one(client, task, tasks, address, reader, forecast=forecast, now=now)

    def _send_one(
        self,
        client: GcsClient,
        task: Task,
        tasks: VehicleTasks,
        address: Address,
        reader: Address,
        *,
        forecast: Forecast | None,
        now: float,
    ) -> None:
        number = self._gcs.link_numbers.get(task.submitter.link, 0)
        status = translate.task_status(
            task, tasks, reader=reader, link_number=number, forecast=forecast, now=now
        )
        client.outlet.send(status, address)

    def _show_timing(self, asked: CommandRequest, *, now: float) -> None:
        task_id = translate.task_id_of(asked.command)
        task = self._registry.get(task_id) if task_id else asked.vehicle.tasks.active
        if task is None:
            words = f"no task {asked.command.params[1]:g}" if task_id else "no task runs"
            raise Rejection(R.NOT_FOUND, words)
        vehicle = self._vehicles.look_at(task.vehicle)
        if vehicle is None:  # its rover is of an earlier run, not heard yet: as for TASK_STATUS
            return
        message = translate.task_timing(
            task,
            vehicle.tasks.timing_of(task),
            period=vehicle.parts.settings.watch.setpoint_period,
            reader=asked.packet.source,
            now=now,
        )
        asked.client.outlet.send(message, vehicle.server_address)
