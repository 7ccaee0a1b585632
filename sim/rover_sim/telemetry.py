"""The content of each telemetry message: the flight stack's state in MAVLink fields and units."""

import math
from collections.abc import Callable
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavModeFlag, MavType
from mav_tasks.mavlink.messages import Message
from rover_sim.estimate import Estimate
from rover_sim.geo import is_on_earth
from rover_sim.mission_storage import FENCE, MISSION, RALLY
from rover_sim.modes import Mode
from rover_sim.onboard import Onboard

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
LEVEL = (1.0, 0.0, 0.0, 0.0)
NONE, NOT_STARTED, ACTIVE, PAUSED, COMPLETE = range(1, 6)  # MISSION_STATE
NOTHING = (0,) * 8
Fields = tuple[Any, ...]


class Telemetry:
    """Builds every message that the rover can send about itself.

    The method for a message has its name, after ``tell_``; it returns the message's fields in their
    order, or None if there is nothing to send.
    """

    _estimate: Estimate  # of the present message
    _boot_ms: int  # ms since boot, of the present message

    def __init__(self, on: Onboard, *, unix_offset: float) -> None:
        self._on = on
        self._flight = on.flight
        self._unix_offset = unix_offset

    def knows(self, message_id: int) -> bool:
        """Return whether this rover can send the message."""
        is_accepted = message_id in self._on.persona.accepted_in_silence
        return is_accepted or self._method_of(message_id) is not None

    def _method_of(self, message_id: int) -> Callable[[], Fields | None] | None:
        if message_id not in m.ALL or message_id in self._on.persona.lacks:
            return None
        return getattr(self, f"tell_{m.ALL[message_id].msgname.lower()}", None)

    def build(self, message_id: int, estimate: Estimate, now: float) -> Message | None:
        """Return the present message; None if there is nothing to send."""
        self._estimate = estimate
        self._boot_ms = int((now - self._on.started) * 1000.0 + 0.5)
        method = self._method_of(message_id)
        fields = None if method is None else method()
        if fields is None:
            return None
        message: Message = m.ALL[message_id](*fields)
        if hasattr(message, "time_boot_ms"):
            if not self._on.boot.tells_its_time(now):
                return None
            message.time_boot_ms %= OVERFLOW
        return message

    def tell_heartbeat(self) -> Fields:
        flight, persona = self._flight, self._on.persona
        armed = MavModeFlag.SAFETY_ARMED if flight.armed else 0
        return (
            MavType.GROUND_ROVER,
            persona.autopilot,
            persona.mode_flags[flight.mode] | armed,
            persona.modes.numbers[flight.mode],
            flight.system_status,
            MAVLINK_VERSION,
        )

    def tell_sys_status(self) -> Fields:
        persona, faults = self._on.persona, self._on.outbox.faults
        present = SENSORS if persona.enables_prearm else SENSORS & ~PREARM
        healthy = present | persona.also_healthy | PREARM
        if not self._is_over("healthy"):
            healthy &= ~PREARM
        enabled = present
        if faults.outside_fence and persona.also_healthy & GEOFENCE:
            enabled, healthy = enabled | GEOFENCE, healthy & ~GEOFENCE
        # load 10 %, 12.6 V, 5 A
        return present, enabled, healthy, 100, 12600, 500, faults.battery, *(0,) * 6

    def tell_extended_sys_state(self) -> Fields:
        armed, disarmed = self._on.persona.landed_states
        return 0, armed if self._flight.armed else disarmed

    def tell_system_time(self) -> Fields:
        unix = self._unix_offset + self._time if self._unix_offset else 0.0
        return int(unix * 1e6), self._boot_ms

    def tell_attitude(self) -> Fields:
        e, has_heading = self._estimate, self._is_over("heading")
        yaw = e.yaw if has_heading else 0.0
        return self._boot_ms, e.roll, e.pitch, yaw, 0.0, 0.0, e.yaw_rate

    def tell_local_position_ned(self) -> Fields | None:
        if not self._is_over("position"):
            return None
        e = self._estimate
        return self._boot_ms, e.north, e.east, e.down, e.vn, e.ve, 0.0

    def tell_global_position_int(self) -> Fields:
        e, heading = self._estimate, _centidegrees(self._estimate.yaw)
        if not self._is_over("position"):
            return self._boot_ms, 0, 0, NO_ALTITUDE, 0, 0, 0, 0, heading
        place = self._on.origin.to_global_cut(e.north, e.east)
        velocity = (_cm(e.vn), _cm(e.ve), 0)
        return self._boot_ms, *place, self._altitude(e), round(-e.down * 1e3), *velocity, heading

    def tell_gps_raw_int(self) -> Fields:
        e, time_us = self._estimate, self._boot_ms * 1000
        has_fix = self._is_over("fix")
        if self._on.outbox.faults.gps_lost or not has_fix:
            return time_us, 0, 0, 0, 0, UNKNOWN_U16, UNKNOWN_U16, 0, 0, 0
        place, course = self._on.origin.to_global(e.north, e.east), math.atan2(e.ve, e.vn)
        motion = (_cm(e.ground_speed), _centidegrees(course))
        # HDOP and VDOP in hundredths; 10 satellites
        return time_us, GPS_FIX_3D, *place, self._altitude(e), 121, 200, *motion, 10

    def _altitude(self, estimate: Estimate) -> int:
        return round((self._on.origin.altitude - estimate.down) * 1e3)

    def tell_vfr_hud(self) -> Fields:
        e, speed = self._estimate, self._estimate.ground_speed
        throttle = min(100, round(abs(e.forward_speed) * 20)) if self._flight.armed else 0
        heading = _centidegrees(e.yaw) // 100
        return speed, speed, heading, throttle, self._on.origin.altitude - e.down, 0.0

    def tell_home_position(self) -> Fields | None:
        if not self._is_over("position"):
            return None
        north, east = self._flight.home
        place = self._on.origin.to_global(north, east)
        altitude, local = round(self._on.origin.altitude * 1e3), (north, east, 0.0)
        if not self._is_over("origin"):  # recorded
            altitude, local = NO_ALTITUDE, (math.nan,) * 3
        return *place, altitude, *local, LEVEL, 0.0, 0.0, 0.0, self._boot_ms * 1000

    def tell_gps_global_origin(self) -> Fields | None:
        on = self._on
        if not (on.realism.tells_origin and self._is_over("origin")):
            return None
        altitude = round(on.origin.altitude * 1e3)
        return *on.origin.in_degrees_e7, altitude, self._boot_ms * 1000

    def tell_rc_channels(self) -> Fields | None:
        sticks = self._on.sticks
        if not sticks.is_there:
            return None
        values = (*sticks.channels(self._time), *(0,) * 10, RSSI_UNKNOWN)
        return self._boot_ms, 8, *values

    def _is_over(self, time: str) -> bool:
        return self._on.boot.has_passed(time, self._time)

    @property
    def _time(self) -> float:
        """The time that the message says."""
        return self._on.started + self._boot_ms * 1e-3

    def tell_battery_status(self) -> Fields:
        return 0, 0, 0, 32767, CELL_VOLTAGES, 500, 0, -1, 100

    def tell_protocol_version(self) -> Fields:
        return 200, 100, 200, NOTHING, NOTHING  # MAVLink 2, minimum 1

    def tell_autopilot_version(self) -> Fields:
        persona = self._on.persona
        return (
            persona.capabilities,
            persona.flight_sw_version,
            *(0, 0, 0),
            tuple(persona.firmware_hash.encode()),
            NOTHING,
            NOTHING,
            *(0, 0),
            self._on.uid,
        )

    def tell_mission_current(self) -> Fields:
        flight, missions = self._flight, self._on.missions
        total = missions.item_count
        if total == 0:
            state = NONE
        elif missions.complete:
            state = COMPLETE
        elif flight.mode is Mode.AUTO and flight.armed:
            state = ACTIVE
        else:
            state = PAUSED if missions.current > 0 else NOT_STARTED
        return (
            flight.current_item,
            total or self._on.persona.no_mission_total,
            state,
            1 if flight.mode is Mode.AUTO else 2,  # in the mission mode, or not
            *map(missions.plan_id, (MISSION, FENCE, RALLY)),
        )

    def tell_position_target_global_int(self) -> Fields | None:
        destination, origin = self._flight.destination, self._on.origin
        if destination is None:
            return None
        place = origin.to_global(*destination)
        if not is_on_earth(*place):
            return None  # a local place far beyond the Earth's coordinates
        return self._boot_ms, 5, TARGET_POSITION_ONLY, *place, origin.altitude, *NOTHING

    def tell_current_mode(self) -> Fields:
        flight, persona = self._flight, self._on.persona
        offered, numbers = persona.offered_modes, persona.modes.numbers
        standard = next((each.standard for each in offered if each.mode is flight.mode), 0)
        return standard, numbers[flight.mode], numbers[flight.intended]


def _cm(metres: float) -> int:
    return round(metres * 100)


def _centidegrees(angle: float) -> int:
    """Return the angle as 0 to 35999."""
    return round(math.degrees(angle) * 100) % 36000
