"""Telemetry: each message comes, in the right units, and messages agree with each other."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.identity import REQUEST_MESSAGE

ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, GPS_RAW_INT = 30, 32, 33, 24
EXTENDED_SYS_STATE = 245
SYSTEM_TIME = 2
WITH_BOOT_TIME = (ATTITUDE, LOCAL_POSITION_NED, GLOBAL_POSITION_INT, SYSTEM_TIME)
UNKNOWN = 65535
YEAR_2015 = 1_420_070_400_000_000  # µs since 1970
METRES_A_DEGREE = 111_320.0
HEADING_TOLERANCE = 10.0  # deg


class Expected(NamedTuple):
    """A message that clients need, and the condition on its fields."""

    name: str
    what: str
    holds: Callable[[Any], bool]


def _on_earth(message: Any) -> bool:
    latitude, longitude = _place(message)
    return abs(latitude) <= 90e7 and abs(longitude) <= 180e7 and (latitude, longitude) != (0, 0)


def _place(message: Any) -> tuple[int, int]:
    if hasattr(message, "latitude"):
        return message.latitude, message.longitude
    return message.lat, message.lon


def _all_finite(message: Any) -> bool:
    return all(math.isfinite(each) for each in message.to_dict().values() if type(each) is float)


TELEMETRY: Mapping[int, Expected] = {
    1: Expected(
        "SYS_STATUS",
        "voltage in mV (65535 unknown), 0 to 100 % left (-1 unknown), load in 0.1 %",
        lambda m: (
            m.load <= 1000
            and (m.voltage_battery == UNKNOWN or 1000 <= m.voltage_battery <= 60000)
            and -1 <= m.battery_remaining <= 100
        ),
    ),
    EXTENDED_SYS_STATE: Expected(
        "EXTENDED_SYS_STATE", "landed_state 1 to 4", lambda m: 1 <= m.landed_state <= 4
    ),
    ATTITUDE: Expected(
        "ATTITUDE",
        "angles in rad, within ±π",
        lambda m: all(abs(angle) <= math.pi + 1e-3 for angle in (m.roll, m.pitch, m.yaw)),
    ),
    LOCAL_POSITION_NED: Expected(
        "LOCAL_POSITION_NED",
        "finite metres from the origin, finite m/s",
        lambda m: _all_finite(m) and math.hypot(m.x, m.y) < 1e5 and math.hypot(m.vx, m.vy) < 50,
    ),
    GLOBAL_POSITION_INT: Expected(
        "GLOBAL_POSITION_INT",
        "degrees × 10⁷, not 0/0; heading in 0.01° (65535 unknown)",
        lambda m: _on_earth(m) and (m.hdg == UNKNOWN or m.hdg < 36000),
    ),
    GPS_RAW_INT: Expected(
        "GPS_RAW_INT", "a 3D fix (3 or better) at a place on Earth", lambda m: (
            m.fix_type >= 3 and _on_earth(m)
        )
    ),
    74: Expected(
        "VFR_HUD",
        "heading 0 to 360°, throttle 0 to 100 %, speed in m/s",
        # a PX4 rover's airspeed is NaN: it has no sensor (1.17)
        lambda m: 0 <= m.heading <= 360 and m.throttle <= 100 and abs(m.groundspeed) < 50,
    ),
    242: Expected("HOME_POSITION", "degrees × 10⁷, not 0/0", _on_earth),
    147: Expected(
        "BATTERY_STATUS",
        "voltages in mV, the first one known; 0 to 100 % left (-1 unknown)",
        lambda m: 1000 <= m.voltages[0] <= UNKNOWN and -1 <= m.battery_remaining <= 100,
    ),
    SYSTEM_TIME: Expected(
        "SYSTEM_TIME",
        "µs since 1970, or 0 for unknown",
        lambda m: m.time_unix_usec == 0 or m.time_unix_usec > YEAR_2015,
    ),
}  # fmt: skip


#: if landed_state is not needed: an ArduPilot Rover sends 0, undefined (4.6.3)
ANY_LANDED_STATE = Expected(
    "EXTENDED_SYS_STATE", "landed_state 0 to 4", lambda m: 0 <= m.landed_state <= 4
)


def check_telemetry(context: Context) -> None:
    """Check the last copy of each message; request those that have not come."""
    probe, report = context.probe, context.report
    asked = dict(TELEMETRY)
    if not context.way.landed_state_counts:
        asked[EXTENDED_SYS_STATE] = ANY_LANDED_STATE
    for message_id, expected in asked.items():
        mark, answer = probe.mark(), None
        message = probe.last(message_id)
        if message is None:
            answer = probe.command(REQUEST_MESSAGE, message_id)
            message = probe.wait(message_id, 1.0, since=mark)
        if message is None:
            seen = f"not streamed; asked for by REQUEST_MESSAGE: {answer}, no message"
            report.fail(expected.name, expected="streamed, or sent on request", seen=seen)
            continue
        how = "streamed" if answer is None else "on request"
        report.expect(
            expected.name,
            expected.holds(message),
            expected=expected.what,
            seen=how if expected.holds(message) else f"{message}",
        )


def check_agreement(context: Context) -> None:
    """Check that boot times follow the clock, and that redundant messages agree."""
    probe, report = context.probe, context.report
    _check_boot_times(context)
    attitude, position = probe.last(ATTITUDE), probe.last(GLOBAL_POSITION_INT)
    name = "one heading"
    if attitude is None or position is None or position.hdg == UNKNOWN:
        report.skip(name, "no ATTITUDE, or no heading in GLOBAL_POSITION_INT")
    else:
        off = (math.degrees(attitude.yaw) - position.hdg / 100 + 180) % 360 - 180
        report.expect(
            name,
            abs(off) <= HEADING_TOLERANCE,
            expected="ATTITUDE.yaw (rad) and GLOBAL_POSITION_INT.hdg (0.01°) within 10°",
            seen=f"{math.degrees(attitude.yaw):.1f}° and {position.hdg / 100:.1f}°",
        )
    raw = probe.last(GPS_RAW_INT)
    name = "one place"
    if raw is None or position is None:
        report.skip(name, "no GPS_RAW_INT, or no GLOBAL_POSITION_INT")
        return
    north = (raw.lat - position.lat) * 1e-7 * METRES_A_DEGREE
    east = (
        (raw.lon - position.lon)
        * 1e-7
        * METRES_A_DEGREE
        * math.cos(math.radians(position.lat * 1e-7))
    )
    report.expect(
        name,
        math.hypot(north, east) < 50.0,
        expected="GPS_RAW_INT and GLOBAL_POSITION_INT within 50 m",
        seen=f"{math.hypot(north, east):.1f} m apart",
    )


def _check_boot_times(context: Context) -> None:
    probe, report = context.probe, context.report
    times = [
        (heard.at, heard.message.time_boot_ms)
        for message_id in WITH_BOOT_TIME
        for heard in probe.since(0, message_id)
    ]
    times.sort(key=lambda pair: pair[0])
    name = "boot times"
    if len(times) < 2 or times[-1][0] - times[0][0] < 1.0:
        report.skip(name, "too few messages with time_boot_ms")
        return
    backwards = sum(
        after.message.time_boot_ms < before.message.time_boot_ms
        for message_id in WITH_BOOT_TIME
        for before, after in pairwise(probe.since(0, message_id))
    )
    (began, first), (ended, last) = times[0], times[-1]
    pace = (last - first) / 1000.0 / (ended - began)
    report.expect(
        name,
        backwards == 0 and 0.7 < pace < 1.3,
        expected="time_boot_ms never backwards, 1,000 a second",
        seen=f"{1000 * pace:.0f} a second, {backwards} times backwards",
    )
