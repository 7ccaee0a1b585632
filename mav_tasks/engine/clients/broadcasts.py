"""Messages to target_system 0, which every stock autopilot takes for its own: one for each rover.

Each rover then sees to its copy, and answers it, as if its own id had been named; DroneKit, for
one, sends 0. MAVLink guide, "Packet Routing". What is only passed on (parameters, setpoints) goes
to all rovers as it came, and STOP to all at once. Task commands name their rover: ids of tasks and
of rovers mean nothing to a crowd.
"""

from copy import copy
from typing import Any

from mav_tasks.engine.clients.gcs_side import Received
from mav_tasks.engine.missions.mission_server import MESSAGES as MISSION_MESSAGES
from mav_tasks.engine.policy import is_task_command
from mav_tasks.engine.vehicles.vehicle_side import VehicleSide
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.codec import Packer

EVERYBODY = 0  # target_system and target_component


class Broadcasts:
    """Turns a message to every rover into one to each."""

    def __init__(self, vehicles: VehicleSide, packer: Packer) -> None:
        self._vehicles = vehicles
        self._packer = packer

    def addressed(self, received: Received) -> list[Received]:
        """Return a copy of a client's packet for each rover; it alone if none is to answer it."""
        if not _is_to_be_answered(received.message):
            return [received]
        unheard = (tasks.vehicle for tasks in self._vehicles.unheard)
        ids = sorted([*self._vehicles.by_id, *unheard])
        return [self._copy(received, system_id) for system_id in ids] or [received]

    def _copy(self, received: Received, system_id: int) -> Received:
        """Return what a client sent to everybody as if it had named this rover's autopilot."""
        message: Any = copy(received.message)  # of several classes, whose fields have these names
        message.target_system = system_id
        if getattr(message, "target_component", AUTOPILOT) == EVERYBODY:
            message.target_component = AUTOPILOT
        packet = received.packet
        raw = self._packer.pack(message, packet.source, seq=packet.seq)
        return received._replace(packet=packet._replace(raw=raw), message=message)


def _is_to_be_answered(message: m.Message | None) -> bool:
    """Whether a message is of a kind that each rover is to answer."""
    if isinstance(message, m.CommandLong | m.CommandInt):
        return not is_task_command(message.command)
    return isinstance(message, (m.SetMode, *MISSION_MESSAGES))
