"""The content of each telemetry message: the flight stack's state in MAVLink fields and units."""

import math
from collections.abc import Callable, Mapping

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavModeFlag, MavType
from mav_tasks.mavlink.messages import Message
from rover_sim.available_modes import standard_mode_of
from rover_sim.boot import Boot
from rover_sim.estimate import Estimate
from rover_sim.flight import FlightControl
from rover_sim.geo import LATITUDE_LIMIT_DEGE7, LONGITUDE_LIMIT_DEGE7, Origin
from rover_sim.mission_conventions import FENCE, MISSION, RALLY
from rover_sim.mission_storage import MissionStorage
from rover_sim.modes import Mode
from rover_sim.personas import Persona
from rover_sim.realism import Realism
from rover_sim.sticks import Sticks

MAVLINK_VERSION = 3
OVERFLOW = 1 << 32  # ms; time_boot_ms wraps after 49.7 days
UNKNOWN_U16 = 65535
# MAV_SYS_STATUS_SENSOR: gyro, accelerometer, compass, GPS, yaw and position control, motors, AHRS,
# pre-arm check. MAVSDK derives "healthy" from these.
SENSORS = 0x1 | 0x2 | 0x4 | 0x20 | 0x1000 | 0x4000 | 0x8000 | 0x200000 | 0x10000000
PREARM, GEOFENCE = 0x10000000, 0x100000
NO_ALTITUDE = 140  # mm, recorded from ArduPilot before it has an origin
RSSI_UNKNOWN = 255
CELL_VOLTAGES = (12600,) + (UNKNOWN_U16,) * 9  # mV; ArduPilot puts the pack's total into the first
GPS_FIX_3D = 3
TARGET_POSITION_ONLY = 0x0DF8  # type_mask of POSITION_TARGET_*
TARGET_VELOCITY_ONLY = 0x0DC7
LEVEL = (1.0, 0.0, 0.0, 0.0)
MISSION_STATES = {"none": 1, "not started": 2, "active": 3, "paused": 4, "complete": 5}


class Telemetry:
    """Builds every message that the rover can send about itself, by message id."""

    def __init__(
        self,
        *,
        persona: Persona,
        system_id: int,
        origin: Origin,
        flight: FlightControl,
        missions: MissionStorage,
        unix_offset: float,
        started: float,
        realism: Realism,
        boot: Boot,
        sticks: Sticks,
    ) -> None:
        self._realism = realism
        self._boot = boot
        self._sticks = sticks
        self._persona = persona
        self._system_id = system_id
        self._origin = origin
        self._flight = flight
        self._missions = missions
        self._unix_offset = unix_offset
        self._started = started
        self._builders: Mapping[int, Callable[[Estimate, int], Message | None]] = {
            m.Heartbeat.id: self._heartbeat,
            m.SysStatus.id: self._sys_status,
            m.SystemTime.id: self._system_time,
            m.GpsRawInt.id: self._gps_raw_int,
            m.Attitude.id: self._attitude,
            m.LocalPositionNed.id: self._local_position_ned,
            m.GlobalPositionInt.id: self._global_position_int,
            m.MissionCurrent.id: self._mission_current,
            m.GpsGlobalOrigin.id: self._gps_global_origin,
            m.VfrHud.id: self._vfr_hud,
            m.PositionTargetGlobalInt.id: self._position_target_global_int,
            m.BatteryStatus.id: self._battery_status,
            m.AutopilotVersion.id: self._autopilot_version,
            m.HomePosition.id: self._home_position,
            m.ExtendedSysState.id: self._extended_sys_state,
            m.ProtocolVersion.id: self._protocol_version,
            m.CurrentMode.id: self._current_mode,
            m.RcChannels.id: self._rc_channels,
            **dict.fromkeys(persona.accepted_in_silence, _nothing),
        }

    def __repr__(self) -> str:
        return f"Telemetry({self._persona.name}, system {self._system_id})"

    def knows(self, message_id: int) -> bool:
        """Return whether this rover can send the message."""
        return message_id in self._builders and message_id not in self._persona.lacks

    def build(self, message_id: int, estimate: Estimate, *, now: float) -> Message | None:
        """Return the present message; None if there is nothing to send."""
        message = self._builders[message_id](estimate, self.boot_ms(now))
        if message is not None and hasattr(message, "time_boot_ms"):
            if not self._boot.tells_its_time(now=now):
                return None
            message.time_boot_ms %= OVERFLOW
        return message

    def boot_ms(self, now: float) -> int:
        """Return milliseconds since this autopilot started."""
        return int((now - self._started) * 1000.0 + 0.5)

    def _heartbeat(self, _estimate: Estimate, _boot_ms: int) -> Message:
        flight, persona = self._flight, self._persona
        armed = MavModeFlag.SAFETY_ARMED if flight.armed else 0
        return m.Heartbeat(
            MavType.GROUND_ROVER,
            persona.autopilot,
            persona.mode_flags[flight.mode] | armed,
            flight.custom_mode,
            flight.system_status,
            MAVLINK_VERSION,
        )

    def _sys_status(self, _estimate: Estimate, boot_ms: int) -> Message:
        present = SENSORS
        if not self._persona.enables_prearm:
            present &= ~PREARM
        healthy = present | self._persona.also_healthy | PREARM
        if not self._boot.is_healthy(now=self._time(boot_ms)):
            healthy &= ~PREARM
        enabled = present
        if self._flight.faults.outside_fence and self._persona.also_healthy & GEOFENCE:
            enabled, healthy = enabled | GEOFENCE, healthy & ~GEOFENCE
        left = self._flight.faults.battery
        return m.SysStatus(
            present, enabled, healthy, 100, 12600, 500, left, 0, 0, 0, 0, 0, 0
        )  # load 10 %, 12.6 V, 5 A

    def _extended_sys_state(self, _estimate: Estimate, _boot_ms: int) -> Message:
        armed, disarmed = self._persona.landed_states
        return m.ExtendedSysState(0, armed if self._flight.armed else disarmed)

    def _system_time(self, _estimate: Estimate, boot_ms: int) -> Message:
        unix = self._unix_offset + self._started + boot_ms * 1e-3 if self._unix_offset else 0.0
        return m.SystemTime(int(unix * 1e6), boot_ms)

    def _attitude(self, estimate: Estimate, boot_ms: int) -> Message:
        if not self._boot.has_heading(now=self._time(boot_ms)):
            estimate = estimate._replace(yaw=0.0)
        return m.Attitude(
            boot_ms, estimate.roll, estimate.pitch, estimate.yaw, 0.0, 0.0, estimate.yaw_rate
        )

    def _local_position_ned(self, estimate: Estimate, boot_ms: int) -> Message | None:
        if not self._boot.has_position(now=self._time(boot_ms)):
            return None
        e = estimate
        return m.LocalPositionNed(boot_ms, e.north, e.east, e.down, e.vn, e.ve, 0.0)

    def _global_position_int(self, estimate: Estimate, boot_ms: int) -> Message:
        latitude, longitude = self._origin.to_global_cut(estimate.north, estimate.east)
        if not self._boot.has_position(now=self._time(boot_ms)):
            heading = _centidegrees(estimate.yaw)
            return m.GlobalPositionInt(boot_ms, 0, 0, NO_ALTITUDE, 0, 0, 0, 0, heading)
        return m.GlobalPositionInt(
            boot_ms,
            latitude,
            longitude,
            round((self._origin.altitude - estimate.down) * 1e3),
            round(-estimate.down * 1e3),
            _cm(estimate.vn),
            _cm(estimate.ve),
            0,
            _centidegrees(estimate.yaw),
        )

    def _gps_raw_int(self, estimate: Estimate, boot_ms: int) -> Message:
        if self._flight.faults.gps_lost or not self._boot.has_fix(now=self._time(boot_ms)):
            return m.GpsRawInt(boot_ms * 1000, 0, 0, 0, 0, UNKNOWN_U16, UNKNOWN_U16, 0, 0, 0)
        latitude, longitude = self._origin.to_global(estimate.north, estimate.east)
        return m.GpsRawInt(
            boot_ms * 1000,
            GPS_FIX_3D,
            latitude,
            longitude,
            round((self._origin.altitude - estimate.down) * 1e3),
            121,  # HDOP and VDOP, hundredths
            200,
            _cm(estimate.ground_speed),
            _centidegrees(math.atan2(estimate.ve, estimate.vn)),
            10,  # satellites
        )

    def _vfr_hud(self, estimate: Estimate, _boot_ms: int) -> Message:
        speed = estimate.ground_speed
        throttle = min(100, round(abs(estimate.forward_speed) * 20)) if self._flight.armed else 0
        heading = _centidegrees(estimate.yaw) // 100
        altitude = self._origin.altitude - estimate.down
        return m.VfrHud(speed, speed, heading, throttle, altitude, 0.0)

    def _home_position(self, _estimate: Estimate, boot_ms: int) -> Message | None:
        now = self._time(boot_ms)
        if not self._boot.has_position(now=now):
            return None
        north, east = self._flight.home
        latitude, longitude = self._origin.to_global(north, east)
        altitude, down = round(self._origin.altitude * 1e3), 0.0
        if not self._boot.has_origin(now=now):  # recorded
            altitude, north, east, down = NO_ALTITUDE, math.nan, math.nan, math.nan
        return m.HomePosition(
            latitude, longitude, altitude, north, east, down, LEVEL, 0.0, 0.0, 0.0, boot_ms * 1000
        )

    def _gps_global_origin(self, _estimate: Estimate, boot_ms: int) -> Message | None:
        told = self._realism.tells_origin and self._boot.has_origin(now=self._time(boot_ms))
        if not told:
            return None
        origin = self._origin
        altitude = round(origin.altitude * 1e3)
        return m.GpsGlobalOrigin(
            origin.latitude_degE7, origin.longitude_degE7, altitude, boot_ms * 1000
        )

    def _rc_channels(self, _estimate: Estimate, boot_ms: int) -> Message | None:
        if not self._sticks.is_there:
            return None
        one, two, three, four, *others = self._sticks.channels(now=self._time(boot_ms))
        five, six, seven, eight = others
        return m.RcChannels(
            boot_ms, 8, one, two, three, four, five, six, seven, eight, *(0,) * 10, RSSI_UNKNOWN
        )

    def _time(self, boot_ms: int) -> float:
        return self._started + boot_ms * 1e-3

    def _battery_status(self, _estimate: Estimate, _boot_ms: int) -> Message:
        return m.BatteryStatus(0, 0, 0, 32767, CELL_VOLTAGES, 500, 0, -1, 100)

    def _autopilot_version(self, _estimate: Estimate, _boot_ms: int) -> Message:
        persona = self._persona
        none = (0,) * 8
        return m.AutopilotVersion(
            persona.capabilities,
            persona.flight_sw_version,
            0,
            0,
            0,
            tuple(persona.firmware_hash.encode()),
            none,
            none,
            0,
            0,
            self._system_id,  # uid: distinguishes simulated rovers
        )

    def _mission_current(self, _estimate: Estimate, _boot_ms: int) -> Message:
        flight, missions = self._flight, self._missions
        return m.MissionCurrent(
            flight.current_item,
            missions.item_count or self._persona.no_mission_total,
            MISSION_STATES[self._mission_state()],
            1 if flight.mode is Mode.AUTO else 2,  # in the mission mode, or not
            missions.plan_id(MISSION),
            missions.plan_id(FENCE),
            missions.plan_id(RALLY),
        )

    def _mission_state(self) -> str:
        flight = self._flight
        if self._missions.item_count == 0:
            return "none"
        if self._missions.complete:
            return "complete"
        if flight.mode is Mode.AUTO and flight.armed:
            return "active"
        return "paused" if self._missions.current > 0 else "not started"

    def _position_target_global_int(self, _estimate: Estimate, boot_ms: int) -> Message | None:
        destination = self._flight.destination
        if destination is None:
            return None
        latitude, longitude = self._origin.to_global(*destination)
        if abs(latitude) > LATITUDE_LIMIT_DEGE7 or abs(longitude) > LONGITUDE_LIMIT_DEGE7:
            return None  # a local place far beyond the Earth's coordinates
        nothing = (0.0,) * 8
        return m.PositionTargetGlobalInt(
            boot_ms, 5, TARGET_POSITION_ONLY, latitude, longitude, self._origin.altitude, *nothing
        )

    def _protocol_version(self, _estimate: Estimate, _boot_ms: int) -> Message:
        return m.ProtocolVersion(200, 100, 200, (0,) * 8, (0,) * 8)  # MAVLink 2, minimum 1

    def _current_mode(self, _estimate: Estimate, _boot_ms: int) -> Message:
        flight = self._flight
        standard = standard_mode_of(flight.mode, self._persona.offered_modes)
        return m.CurrentMode(standard, flight.custom_mode, flight.intended_custom_mode)


def _nothing(_estimate: Estimate, _boot_ms: int) -> Message | None:
    return None


def _cm(metres: float) -> int:
    return round(metres * 100)


def _centidegrees(angle: float) -> int:
    """Return the angle as 0 to 35999."""
    return round(math.degrees(angle) * 100) % 36000
