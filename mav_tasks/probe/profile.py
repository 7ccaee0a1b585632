"""The profile that follows from what a probe has found: what the server drives by."""

from mav_tasks.config.settings import VehicleProfile
from mav_tasks.probe.findings import Findings


def why_none(findings: Findings) -> str:
    """Return in words why there is no profile to keep; "": there is one."""
    drive = findings.drive
    if drive is None:
        return "only --drive measures one"
    if not findings.firmware:
        return "the rover does not report its firmware"
    if drive.ended and drive.loss_stop != "no":  # that it drives on is worth keeping in any case
        return "the drive was not completed"
    return ""


def profile_of(findings: Findings, *, probed: str) -> VehicleProfile:
    """Return it; ``probed`` is when, UTC. There must be one, see ``why_none``."""
    drive = findings.drive
    assert drive is not None
    return VehicleProfile(
        system_id=findings.system_id,
        uid=findings.uid,
        autopilot=findings.autopilot,
        firmware=findings.firmware,
        probed=probed,
        yaw_rate=drive.yaw_rate,
        reverse=drive.reverse,
        turning=findings.turning,
        turning_radius=findings.turning_radius,
        setpoints=tuple(drive.accepted),
        loss_stop=drive.loss_stop,
        setpoint_timeout=drive.setpoint_timeout,
        speed=drive.speed,
        stopping_distance=drive.stopping_distance,
        stopping_time=drive.stopping_time,
    )
