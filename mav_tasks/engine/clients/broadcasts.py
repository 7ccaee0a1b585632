"""Copies a message to target_system 0 for each rover: every stock autopilot accepts 0 as its own.

Each copy is processed and answered as if it named its rover; DroneKit, for one, sends 0. MAVLink
guide, "Packet Routing". Messages that are only forwarded (parameters, setpoints) go to all rovers
unchanged, and STOP to all at once. Other task commands must name their rover: a task id belongs to
one rover.
"""

from copy import copy
from dataclasses import dataclass
from typing import Any

from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.missions.plan_transfer import MissionMessage
from mav_tasks.engine.policy import is_task_command
from mav_tasks.engine.services.commands import command_of
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, BROADCAST
from mav_tasks.mavlink.codec import Packer


@dataclass(repr=False, eq=False)
class Broadcasts:
    """The copier of messages to all rovers."""

    _vehicles: VehicleSide
    _packer: Packer

    def addressed(self, received: Received) -> list[Received]:
        """Return a copy of a client's packet for each rover; only the packet if none answers it."""
        command = received.command
        if not isinstance(received.message, m.SetMode | MissionMessage) and (
            command is None or is_task_command(command.command)
        ):
            return [received]
        ids = sorted([*self._vehicles.by_id, *(tasks.vehicle for tasks in self._vehicles.unheard)])
        return [self._copy(received, system_id) for system_id in ids] or [received]

    def _copy(self, received: Received, system_id: int) -> Received:
        """Return a client's packet with this rover's autopilot as its target."""
        message: Any = copy(received.message)  # one of several classes with these fields
        message.target_system = system_id
        if getattr(message, "target_component", AUTOPILOT) == BROADCAST:
            message.target_component = AUTOPILOT
        packet = received.packet
        raw = self._packer.pack(message, packet.source, seq=packet.seq)
        command = None if received.command is None else command_of(message)
        return received._replace(packet=packet._replace(raw=raw), message=message, command=command)
