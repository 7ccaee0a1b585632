"""Which vehicle this is, and what runs on it, as its AUTOPILOT_VERSION says. MAVLink common."""

from dataclasses import dataclass

from mav_tasks.mavlink.messages import AutopilotVersion

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
