"""The vehicle as the station sees it, from the telemetry of component 1."""

from math import nan
from typing import NamedTuple

from tests.kit.qgc.wire import Message

APM, PX4, GENERIC = "apm", "px4", "generic"
FIRMWARE = {3: APM, 12: PX4}  # MAV_AUTOPILOT; everything else is generic [1.1]
NO_VEHICLES = frozenset({6, 18, 26, 27})  # MAV_TYPE GCS, ONBOARD_CONTROLLER, GIMBAL, ADSB [1.1]
ARMED = 128
ACTIVE, CRITICAL, EMERGENCY = 4, 5, 6  # MAV_STATE
NOT_LANDED = frozenset({2, 3, 4})  # MAV_LANDED_STATE IN_AIR, TAKEOFF, LANDING


class Modes(NamedTuple):
    """The custom_mode numbers of the buttons [1.5]."""

    hold: int
    mission: int
    back: int
    guided: int


MODES = {
    APM: Modes(hold=4, mission=10, back=11, guided=15),
    PX4: Modes(hold=0x03040000, mission=0x04040000, back=0x05040000, guided=0x03040000),
}


class Place(NamedTuple):
    """Degrees, and metres above sea level."""

    latitude: float
    longitude: float
    altitude: float = nan


class VehicleState:
    """The last received state; the first heartbeat determines the make for good [1.1]."""

    def __init__(self, heartbeat: Message, *, now: float) -> None:
        self.firmware = FIRMWARE.get(heartbeat.autopilot, GENERIC)
        self.heard_at = now
        self.landed_state = 0  # unknown
        self.place: Place | None = None
        self.relative_altitude = nan
        self.home: Place | None = None
        self._take_heartbeat(heartbeat)

    @property
    def modes(self) -> Modes | None:
        """The modes that the station knows by name."""
        return MODES.get(self.firmware)

    @property
    def is_in_mission_mode(self) -> bool:
        """Whether it is in mission mode, in which no plan is uploaded while armed."""
        return self.modes is not None and self.mode == self.modes.mission

    @property
    def is_flying(self) -> bool:
        """Whether it counts as flying, which shows most buttons of the fly view [2.6]."""
        if self.firmware == APM:
            return self.armed and self.status in (ACTIVE, CRITICAL, EMERGENCY)
        return self.landed_state in NOT_LANDED

    def receive(self, name: str, message: Message) -> None:
        """Take a message of component 1."""
        if name == "HEARTBEAT":
            self._take_heartbeat(message)
        elif name == "EXTENDED_SYS_STATE":
            self.landed_state = message.landed_state
        elif name == "GLOBAL_POSITION_INT":
            self.relative_altitude = message.relative_alt / 1e3
            altitude = message.alt / 1e3
            if message.lat or message.lon:
                self.place = Place(message.lat / 1e7, message.lon / 1e7, altitude)
        elif name == "HOME_POSITION":
            self.home = Place(
                message.latitude / 1e7, message.longitude / 1e7, message.altitude / 1e3
            )

    def _take_heartbeat(self, message: Message) -> None:
        self.base_mode: int = message.base_mode
        self.mode: int = message.custom_mode
        self.status: int = message.system_status
        self.armed = bool(message.base_mode & ARMED)
