"""The rovers that a client knows, from their packets. Pure."""

from collections.abc import Iterator, Sequence
from math import hypot
from typing import Any

from mav_tasks.basics.errors import NoSuchVehicle
from mav_tasks.client.values import VehicleStatus, known
from mav_tasks.engine.services.persona import Persona, persona_of
from mav_tasks.engine.services.vehicle_status import HeartbeatMonitor, charge_of, passes_checks
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import AUTOPILOT, Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavAutopilot
from mav_tasks.mavlink.packet import Packet

SILENT_AFTER = 3.5  # s without a heartbeat; same as in the server
GAP = 1.7  # s without a heartbeat, after which the server may be another process
ASK_AGAIN = 0.6  # s between requests to a vehicle's task server until it answers

DEGREE = 1e7  # of MAVLink's integers
UNKNOWN_VOLTAGE = 65535

POSITIONS = frozenset({m.LocalPositionNed.id, m.GlobalPositionInt.id})
#: telemetry messages whose latest packet is kept
KEPT = POSITIONS | {m.Attitude.id, m.SysStatus.id}


class VehicleView:
    """A rover that is heard, or that a task server reported."""

    def __init__(self, system_id: int, *, now: float) -> None:
        self.system_id = system_id
        self._monitor: HeartbeatMonitor | None = None  # None: no heartbeat yet
        #: when the rover's last heartbeat reached the server; None: unknown
        self.server_heard_at: float | None = None
        #: component id of its task server; None until the server has answered
        self.server_component: int | None = None
        self.ask_at = now
        self.latest: dict[int, Packet] = {}
        self._placed_at: float | None = None  # when the last position arrived

    def __repr__(self) -> str:
        return f"VehicleView({self.system_id}, server {self.server_component})"

    @property
    def has_home_item(self) -> bool | None:
        """Whether its missions begin with a home item; None before the first heartbeat."""
        if self._monitor is None:
            return None
        return self._persona is not None and self._persona.has_home_item

    def heartbeat(self, message: m.Heartbeat, *, now: float) -> bool:
        """Process a heartbeat. Return whether it is the first, or the first after a gap."""
        if self._monitor is None:
            self._monitor = HeartbeatMonitor(message, lost_after=SILENT_AFTER, now=now)
            return True
        is_back = now - self._monitor.heard_at > GAP
        self._monitor.receive(message, now=now)
        return is_back

    def heartbeat_age(self, *, now: float) -> float | None:
        """Return seconds since the last heartbeat; inf: none in the server's run; None: unknown."""
        heard = [] if self._monitor is None else [self._monitor.heard_at]
        heard += [] if self.server_heard_at is None else [self.server_heard_at]
        return now - max(heard) if heard else None

    def telemetry(self, packet: Packet, *, now: float) -> None:
        """Keep a telemetry packet; ``status`` decodes it."""
        self.latest[packet.message_id] = packet
        if packet.message_id in POSITIONS:
            self._placed_at = now

    def status(self, decoder: Decoder, *, now: float) -> VehicleStatus:
        """Return the rover's last known state."""
        place = self._latest(decoder, m.LocalPositionNed)
        on_earth = self._latest(decoder, m.GlobalPositionInt)
        system = self._latest(decoder, m.SysStatus)
        attitude = self._latest(decoder, m.Attitude)
        monitor = self._monitor
        return VehicleStatus(
            id=self.system_id,
            kind=self._kind,
            armed=None if monitor is None else monitor.armed,
            mode="unknown" if monitor is None else self._mode_of(monitor.custom_mode),
            is_heard=monitor is not None and monitor.is_heard(now=now),
            server_component=self.server_component or 0,
            heartbeat_age=self.heartbeat_age(now=now),
            north=None if place is None else known(place.x),
            east=None if place is None else known(place.y),
            yaw=None if attitude is None else known(attitude.yaw),
            speed=None if place is None else known(hypot(place.vx, place.vy)),
            latitude=None if on_earth is None else on_earth.lat / DEGREE,
            longitude=None if on_earth is None else on_earth.lon / DEGREE,
            position_age=None if self._placed_at is None else now - self._placed_at,
            battery=None if system is None else charge_of(system),
            voltage=None if system is None else _voltage_of(system),
            is_ready=None if system is None else passes_checks(system),
        )

    @property
    def _persona(self) -> Persona | None:
        return None if self._monitor is None else persona_of(self._monitor.latest)

    @property
    def _kind(self) -> str:
        if self._monitor is None:
            return "unknown"
        return "other" if self._persona is None else self._persona.name

    def _mode_of(self, mode: int) -> str:
        return f"mode {mode}" if self._persona is None else self._persona.mode_name(mode)

    def _latest(self, decoder: Decoder, kind: type[m.Message]) -> Any:
        packet = self.latest.get(kind.id)
        return None if packet is None else decoder.decode(packet)


class FleetView:
    """All rovers that a client knows."""

    def __init__(self) -> None:
        self._views: dict[int, VehicleView] = {}
        #: whether a server has listed its rovers
        self.is_listed = False
        #: whether another rover with the same system id is heard, by system id
        self.shared: dict[int, bool] = {}

    def __repr__(self) -> str:
        return f"FleetView({list(self._views.values())})"

    def __iter__(self) -> Iterator[VehicleView]:
        return iter(self._views.values())

    def get(self, system_id: int) -> VehicleView | None:
        """Return a rover, None if it is not known."""
        return self._views.get(system_id)

    def served(self) -> list[int]:
        """Return the sorted ids of the rovers whose task server has answered."""
        return sorted(v.system_id for v in self if v.server_component is not None)

    def is_found(self, wished: int | None) -> bool:
        """Return whether the task server of a vehicle, None: of every vehicle, has answered."""
        if wished is not None:
            return wished in self.served()
        are_served = all(v.server_component is not None for v in self)
        return self.is_listed and bool(self._views) and are_served

    def why_not_found(self, wished: int | None) -> str:
        """Return the reason as text; "{where}" is a placeholder for the link and the time-out."""
        served = self.served()
        if not self._views and self.is_listed:
            return "the task server has heard no rover {where}: is the rover on and connected?"
        if not self._views:
            return "no task server answered {where}: is it running?"
        if not served:
            return f"rover {min(self._views)} is heard {{where}}, but no task server answered"
        return f"rover {wished} was not found {{where}}; {_there_are(served)}"

    def which(self, wished: int | None) -> int:
        """Return ``wished``, None: the only vehicle.

        Raise NoSuchVehicle if the server does not have it, or if there is not exactly one.
        """
        served = self.served()
        if wished is not None and wished not in served:
            raise NoSuchVehicle(f"no rover {wished}; {_there_are(served)}")
        if wished is not None:
            return wished
        if len(served) != 1:
            raise NoSuchVehicle(f"{_there_are(served)}: choose one")
        return served[0]

    def heartbeat(self, packet: Packet, message: m.Heartbeat, *, now: float) -> bool:
        """Process a heartbeat. Return whether its rover is new, or back after a gap.

        After a gap the server may be another process.
        """
        if packet.component_id != AUTOPILOT or message.autopilot == MavAutopilot.INVALID:
            return False
        view = self._view(packet.system_id, now=now)
        is_new = view.heartbeat(message, now=now)
        if is_new:
            view.ask_at = now
        return is_new

    def served_by(self, source: Address, age: float | None, *, now: float) -> None:
        """Note that a task server has a rover; the rover itself may be silent.

        ``age``: seconds since the rover's last heartbeat at the server; inf: none; None: unknown.
        """
        view = self._view(source.system_id, now=now)
        view.server_component = source.component_id
        view.server_heard_at = None if age is None else now - age

    def telemetry(self, packet: Packet, *, now: float) -> bool:
        """Keep a vehicle's telemetry packet. Return whether it is one of a known vehicle."""
        view = self._views.get(packet.system_id)
        if view is None or packet.component_id != AUTOPILOT:
            return False
        view.telemetry(packet, now=now)
        return True

    def _view(self, system_id: int, *, now: float) -> VehicleView:
        view = self._views.get(system_id)
        if view is None:
            view = self._views[system_id] = VehicleView(system_id, now=now)
        return view

    def next_deadline(self) -> float | None:
        """Return when to ask the next task server; None: all have answered."""
        due = [v.ask_at for v in self if v.server_component is None]
        return min(due, default=None)

    def to_ask(self, *, now: float) -> list[int]:
        """Return the vehicles whose task server to ask now."""
        due = [v for v in self if v.server_component is None and now >= v.ask_at]
        for view in due:
            view.ask_at = now + ASK_AGAIN
        return [view.system_id for view in due]


def _voltage_of(message: m.SysStatus) -> float | None:
    voltage = message.voltage_battery
    return None if voltage in (0, UNKNOWN_VOLTAGE) else voltage / 1000


def _there_are(ids: Sequence[int]) -> str:
    if not ids:
        return "the server has no rover"
    if len(ids) == 1:
        return f"the server has rover {ids[0]}"
    return f"the server has rovers {', '.join(map(str, ids))}"
