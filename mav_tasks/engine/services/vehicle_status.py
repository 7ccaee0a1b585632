"""What a vehicle says of itself: HEARTBEAT, SYS_STATUS and AUTOPILOT_VERSION; and our heartbeat.

MAVLink guide, "Heartbeat/Connection"; MAVLink common: MAV_SYS_STATUS_SENSOR.
"""

from dataclasses import dataclass
from functools import cache

from mav_tasks.mavlink.enums import MavAutopilot, MavModeFlag, MavState, MavType
from mav_tasks.mavlink.messages import AutopilotVersion, Heartbeat, SysStatus

INTERVAL = 1.0  # s, MAVLink guide


def kind_of(heartbeat: Heartbeat) -> tuple[int, int]:
    """Return what tells one kind of vehicle from another."""
    return heartbeat.type, heartbeat.autopilot


class HeartbeatMonitor:
    """What a vehicle's heartbeats say, and whether they still come."""

    def __init__(self, first: Heartbeat, *, lost_after: float, now: float) -> None:
        #: s of silence after which it is not heard any more
        self.lost_after = lost_after
        self.receive(first, now=now)

    def __repr__(self) -> str:
        return f"HeartbeatMonitor(mode={self.custom_mode}, armed={self.armed})"

    @property
    def custom_mode(self) -> int:
        """The autopilot's own mode number."""
        return int(self.latest.custom_mode)

    @property
    def may_be_armed(self) -> bool:
        """Whether it said that it is armed, though it may have restarted since."""
        return bool(self.latest.base_mode & MavModeFlag.SAFETY_ARMED)

    def receive(self, heartbeat: Heartbeat, *, now: float) -> None:
        self.latest = heartbeat
        #: whether the vehicle says that it is armed
        self.armed = self.may_be_armed
        self.heard_at = now

    def restarted(self) -> None:
        """It has restarted, and a restart disarms, whatever it has said before."""
        self.armed = False

    def is_heard(self, *, now: float) -> bool:
        return now - self.heard_at <= self.lost_after


class HeartbeatSender:
    """The rhythm of heartbeats that we send: the first at once, then one a second."""

    def __init__(self, *, now: float) -> None:
        self._next_at = now

    def next_deadline(self) -> float:
        return self._next_at

    def is_due(self, *, now: float) -> bool:
        """Whether one is to be sent now; plans the next, without a burst after a late wake-up."""
        if now < self._next_at:
            return False
        self._next_at = max(self._next_at + INTERVAL, now + 0.5 * INTERVAL)
        return True


@cache
def gcs_heartbeat() -> Heartbeat:
    """Return what the server says of itself on vehicle links: a ground station."""
    return Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)


@cache
def component_heartbeat(state: MavState) -> Heartbeat:
    """Return what the task server's component inside a vehicle's system says to clients.

    Autopilot INVALID and base_mode 0, because MAVSDK takes flight mode and autopilot type from any
    component that says more.
    """
    return Heartbeat(MavType.ONBOARD_CONTROLLER, MavAutopilot.INVALID, 0, 0, state, 3)


UNKNOWN = -1  # battery_remaining
GEOFENCE, PREARM_CHECK = 0x100000, 0x10000000  # MAV_SYS_STATUS_…


def charge_of(message: SysStatus) -> float | None:
    """Return the charge that is left, 0 to 1; None: the rover does not know it."""
    percent = message.battery_remaining
    return None if percent == UNKNOWN else min(max(percent / 100, 0.0), 1.0)


def passes_checks(message: SysStatus) -> bool | None:
    """Return whether the checks pass; None: the rover does not report them."""
    is_healthy = bool(message.onboard_control_sensors_health & PREARM_CHECK)
    # PX4 1.17 sets the bit in health only
    is_reported = is_healthy or bool(message.onboard_control_sensors_present & PREARM_CHECK)
    return is_healthy if is_reported else None


def is_outside_fence(message: SysStatus) -> bool:
    """Return whether a fence that is switched on is reported as unhealthy."""
    is_on = message.onboard_control_sensors_enabled & GEOFENCE
    return bool(is_on) and not message.onboard_control_sensors_health & GEOFENCE


#: FIRMWARE_VERSION_TYPE, by the least number of each
KINDS = ((255, ""), (192, "-rc"), (128, "-beta"), (64, "-alpha"), (0, "-dev"))


@dataclass(frozen=True, slots=True)
class VehicleIdentity:
    """A vehicle and its firmware, in words; "" where it does not say."""

    uid: str
    firmware: str


def identity_of(version: AutopilotVersion) -> VehicleIdentity:
    return VehicleIdentity(uid_of(version), firmware_of(version))


def uid_of(version: AutopilotVersion) -> str:
    """Return what tells this vehicle from all others, "" if it does not say."""
    if any(version.uid2):
        return bytes(version.uid2).hex()
    return f"{version.uid:x}" if version.uid else ""


def firmware_of(version: AutopilotVersion) -> str:
    """Return version and hash: ``4.6.3 3fc7011a``; "" if it does not say."""
    number = version.flight_sw_version
    if not number:
        return ""
    major, minor, patch, kind = (number >> shift & 0xFF for shift in (24, 16, 8, 0))
    words = next(words for least, words in KINDS if kind >= least)
    return f"{major}.{minor}.{patch}{words} {_hash_of(version)}".rstrip()


def _hash_of(version: AutopilotVersion) -> str:
    """ArduPilot has it in letters, PX4 in bytes."""
    data = bytes(version.flight_custom_version)
    if not any(data):
        return ""
    text = data.rstrip(b"\0")
    return text.decode("ascii") if text.isalnum() else data.hex()
