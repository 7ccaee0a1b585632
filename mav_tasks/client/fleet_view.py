"""The rovers that a client hears, each as its packets show it. Pure."""

from collections.abc import Iterator, Sequence
from math import hypot
from typing import Any

from mav_tasks.client.values import VehicleStatus
from mav_tasks.errors import NoSuchVehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavAutopilot
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.heartbeat import HeartbeatMonitor
from mav_tasks.services.persona import PERSONAS

SILENT_AFTER = 3.5  # s without a heartbeat; as the server has it
GAP = 1.7  # s between two heartbeats, after which the server may be another process
ASK_AGAIN = 0.6  # s, until a vehicle's task server has shown itself

#: telemetry of which the latest is kept
KEPT = frozenset({m.LocalPositionNed.id, m.Attitude.id})


class VehicleView:
    """One system with an autopilot."""

    def __init__(self, system_id: int, first: m.Heartbeat, *, now: float) -> None:
        self.system_id = system_id
        self.monitor = HeartbeatMonitor(first, lost_after=SILENT_AFTER, now=now)
        #: of the task server inside it; None until that has answered
        self.server_component: int | None = None
        self.ask_at = now
        self.latest: dict[int, Packet] = {}

    def __repr__(self) -> str:
        return f"VehicleView({self.system_id}, server {self.server_component})"

    @property
    def has_home_item(self) -> bool:
        """Whether the first item of a mission is home there."""
        persona = PERSONAS.get(self.monitor.latest.autopilot)
        return persona is not None and persona.has_home_item

    def status(self, decoder: Decoder, *, now: float) -> VehicleStatus:
        """Give what is known of it."""
        place = self._latest(decoder, m.LocalPositionNed)
        attitude = self._latest(decoder, m.Attitude)
        persona = PERSONAS.get(self.monitor.latest.autopilot)
        mode = self.monitor.custom_mode
        return VehicleStatus(
            id=self.system_id,
            kind="other" if persona is None else persona.name,
            armed=self.monitor.armed,
            mode=f"mode {mode}" if persona is None else persona.mode_name(mode),
            is_heard=self.monitor.is_heard(now=now),
            server_component=self.server_component or 0,
            north=None if place is None else place.x,
            east=None if place is None else place.y,
            yaw=None if attitude is None else attitude.yaw,
            speed=None if place is None else hypot(place.vx, place.vy),
        )

    def _latest(self, decoder: Decoder, kind: type[m.Message]) -> Any:
        packet = self.latest.get(kind.id)
        return None if packet is None else decoder.decode(packet)


class FleetView:
    """All of them."""

    def __init__(self) -> None:
        self._views: dict[int, VehicleView] = {}

    def __repr__(self) -> str:
        return f"FleetView({list(self._views.values())})"

    def __iter__(self) -> Iterator[VehicleView]:
        return iter(self._views.values())

    def get(self, system_id: int) -> VehicleView | None:
        """Give one, None if it was never heard."""
        return self._views.get(system_id)

    def served(self) -> list[int]:
        """Give the ids of those in which a task server has answered, the lowest first."""
        return sorted(v.system_id for v in self if v.server_component is not None)

    def is_found(self, wished: int | None) -> bool:
        """Whether the task server of a vehicle has answered; None: that of each that is heard."""
        if wished is not None:
            return wished in self.served()
        return bool(self._views) and all(v.server_component is not None for v in self)

    def why_not_found(self, wished: int | None) -> str:
        """Give why, in words; "{where}" stands for where and how long it was listened for."""
        served = self.served()
        if not self._views:
            return "nothing heard {where}: is the server running, and has it a rover?"
        if not served:
            return f"rover {min(self._views)} is heard {{where}}, but no task server answered"
        return f"rover {wished} was not found {{where}}: there is {_list(served)}"

    def which(self, wished: int | None) -> int:
        """Give the vehicle that is meant, None: the only one. NoSuchVehicle."""
        served = self.served()
        if wished is not None and wished not in served:
            raise NoSuchVehicle(f"rover {wished} is not there: there is {_list(served)}")
        if wished is not None:
            return wished
        if len(served) != 1:
            raise NoSuchVehicle(f"there is {_list(served)}: name the one that is meant")
        return served[0]

    def heartbeat(self, packet: Packet, message: m.Heartbeat, *, now: float) -> bool:
        """Take an autopilot's heartbeat in; whether it is one that may be new here.

        New is also one that comes back: behind it there may be another server process.
        """
        if packet.component_id != AUTOPILOT or message.autopilot == MavAutopilot.INVALID:
            return False
        view = self._views.get(packet.system_id)
        if view is None:
            self._views[packet.system_id] = VehicleView(packet.system_id, message, now=now)
            return True
        is_back = now - view.monitor.heard_at > GAP
        view.monitor.receive(message, now=now)
        if is_back:
            view.ask_at = now
        return is_back

    def telemetry(self, packet: Packet) -> None:
        """Keep a vehicle's telemetry, to be looked at when somebody asks."""
        view = self._views.get(packet.system_id)
        if view is not None and packet.component_id == AUTOPILOT:
            view.latest[packet.message_id] = packet

    def next_deadline(self) -> float | None:
        """Give when a task server is to be asked whether it is there."""
        due = [v.ask_at for v in self if v.server_component is None]
        return min(due, default=None)

    def to_ask(self, *, now: float) -> list[int]:
        """Give the vehicles whose task server is to be asked now."""
        due = [v for v in self if v.server_component is None and now >= v.ask_at]
        for view in due:
            view.ask_at = now + ASK_AGAIN
        return [view.system_id for view in due]


def _list(ids: Sequence[int]) -> str:
    if not ids:
        return "none"
    return ("rover " if len(ids) == 1 else "rovers ") + ", ".join(map(str, ids))
