"""Routes incoming packets to the parts that handle them; halts come first."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter

from mav_tasks.engine.clients.broadcasts import EVERYBODY, Broadcasts
from mav_tasks.engine.clients.elsewhere import Elsewhere
from mav_tasks.engine.clients.gcs_side import GcsSide, Received
from mav_tasks.engine.clients.message_requests import MessageRequests
from mav_tasks.engine.clients.parameters import ParameterServer, ParamMessage
from mav_tasks.engine.clients.publisher import Publisher
from mav_tasks.engine.clients.refusals import Refusals
from mav_tasks.engine.clients.restart_watch import RestartWatch
from mav_tasks.engine.clients.rights import OPERATOR
from mav_tasks.engine.commands.command_request import MessageRequest
from mav_tasks.engine.commands.dispatch import Commands
from mav_tasks.engine.commands.forwarder import Forwarder
from mav_tasks.engine.commands.mode_requests import ModeRequests
from mav_tasks.engine.commands.task_control import TaskControl
from mav_tasks.engine.commands.words import kind_of_message
from mav_tasks.engine.inputs import FLEET_LINK, Packets
from mav_tasks.engine.missions.mission_reports import MissionReports
from mav_tasks.engine.missions.mission_server import MissionMessage, MissionServers
from mav_tasks.engine.packet_reader import PacketReader
from mav_tasks.engine.policy import Kind
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.services.command_receiver import command_of


@dataclass(repr=False, eq=False)
class Reception:
    """Handles what all links deliver."""

    gcs: GcsSide
    vehicles: VehicleSide
    intake: PacketReader
    refusals: Refusals
    elsewhere: Elsewhere
    broadcasts: Broadcasts
    commands: Commands
    control: TaskControl
    modes: ModeRequests
    displays: MessageRequests
    desks: MissionServers
    parameters: ParameterServer
    passing: Forwarder
    publisher: Publisher
    reports: MissionReports
    restarts: RestartWatch = field(default_factory=RestartWatch)

    def __repr__(self) -> str:
        return f"Reception({self.intake!r})"

    def receive(self, items: Sequence[Packets], *, now: float) -> None:
        """Handle packets in the order of their arrival; those that halt a rover come first."""
        received: list[Received] = []
        others: list[Packets] = []
        for item in items:
            if item.link in self.gcs.links:
                if item.link == FLEET_LINK:
                    item = self.elsewhere.bring_back(item)
                received += self._received(item, now=now)
            else:
                others.append(item)
        if len(items) > 1:
            received.sort(key=attrgetter("arrived"))
        if len(received) > 1:
            for each in self._halts_first(received):
                self.gcs.hear_out(each, now=now)
                self._receive_from_client(each, now=now)
        elif received:
            self._receive_from_client(received[0], now=now)
        for item in others:
            if self.vehicles.links.owns(item.link):
                self._receive_from_vehicles(item, now=now)

    def _received(self, item: Packets, *, now: float) -> list[Received]:
        taken = self.intake.packets(self.gcs.let_in(item, now=now), self.gcs.counts, now=now)
        received: list[Received] = []
        for peer, packet, arrived in taken:
            if each := self.gcs.receive(item.link, peer, packet, arrived=arrived, now=now):
                received.append(each)
        return received

    def _receive_from_vehicles(self, item: Packets, *, now: float) -> None:
        for peer, packet, _ in self.intake.packets(item, self.vehicles.counts, now=now):
            vehicle = self.vehicles.receive(item.link, peer, packet, now=now)
            while self.vehicles.gone:
                self.forget(self.vehicles.gone.pop())
            if vehicle is not None:
                if self.restarts.begins_anew(packet, now=now):
                    self.gcs.continue_numbers(packet)
                is_ours = self.vehicles.is_answer_to_us(packet)
                if is_ours or packet.message_id == m.CommandAck.id or self.reports.replaces(packet):
                    self.publisher.withhold(packet)
                else:
                    is_stopped = vehicle.tasks.is_stopped
                    shown = vehicle.shown.applied(packet, is_stopped=is_stopped, now=now)
                    self.gcs.forward(shown, now=now)

    def _halts_first(self, received: list[Received]) -> list[Received]:
        """Move packets that start or drive a rover behind those that halt one.

        The order is otherwise kept.
        """
        kinds = [self._kind_of(each.message) for each in received]
        if Kind.HALT not in kinds or (Kind.GO not in kinds and Kind.MOTION not in kinds):
            return received
        goes = [kind in (Kind.GO, Kind.MOTION) for kind in kinds]
        return [
            *(each for each, is_last in zip(received, goes, strict=True) if not is_last),
            *(each for each, is_last in zip(received, goes, strict=True) if is_last),
        ]

    def _kind_of(self, message: m.Message | None) -> Kind:
        target = getattr(message, "target_system", 0)
        is_of_all = target in (EVERYBODY, self.vehicles.our_address.system_id)
        vehicle = (
            next(iter(self.vehicles.all), None) if is_of_all else self.vehicles.look_at(target)
        )
        return Kind.WISH if vehicle is None else kind_of_message(message, vehicle.persona)

    def stop_taken(self, vehicle: int, *, now: float) -> None:
        """Obey the STOPs that came before this gateway got a vehicle, and that nobody obeyed."""
        for received in self.elsewhere.stops_for(vehicle, now=now):
            self.gcs.hear_out(received, now=now)
            self._see_to(received, now=now)
        self.elsewhere.obeyed(vehicle)

    def forget(self, vehicle: int) -> None:
        """Forget a vehicle, which another gateway, or another vehicle, has the id of from now."""
        self.desks.forget(vehicle)
        self.reports.forget(vehicle)
        self.restarts.forget(vehicle)

    def _receive_from_client(self, received: Received, *, now: float) -> None:
        if not self.refusals.may_pass(received, now=now) or self.elsewhere.takes(received, now=now):
            return
        if len(received.client.introduced) < len(self.vehicles.by_id):
            self.publisher.welcome(received.client, now=now)
        if getattr(received.message, "target_system", None) == EVERYBODY:
            for each in self.broadcasts.addressed(received):
                self._see_to(each, now=now)
        else:
            self._see_to(received, now=now)

    def _see_to(self, received: Received, *, now: float) -> None:
        client, packet, message = received.client, received.packet, received.message
        if isinstance(message, m.CommandLong | m.CommandInt):
            self.commands.receive(client, packet, command_of(message), now=now)
        elif isinstance(message, (m.CommandCancel, m.SetMode)):
            vehicle = self.vehicles.get(message.target_system)
            if vehicle is None:
                return
            if isinstance(message, m.CommandCancel):
                self.control.cancel_latest(client, vehicle, packet.source, message.command, now=now)
            else:
                asked = MessageRequest.of(
                    client, vehicle, packet, int(message.custom_mode), now=now
                )
                self.modes.heard(asked, now=now)
        elif isinstance(message, m.RequestDataStream):
            self.displays.set_streams(client, message)
        elif isinstance(message, m.SetupSigning):
            self.displays.set_up_signing(client, message, now=now)
        elif isinstance(message, MissionMessage) and self.desks.receive(
            client, packet, message, now=now
        ):
            return
        else:
            if isinstance(message, m.Heartbeat) and packet.system_id in self.vehicles.by_id:
                return  # of a rover's component: back by another link, it would be on its side
            if isinstance(message, m.Heartbeat) and client.rights.reach(OPERATOR):
                self.publisher.hear_operator(message, now=now)
            elif isinstance(message, ParamMessage):
                self.parameters.receive(client, packet, message, now=now)
            self.passing.forward(client, packet, message, now=now)
