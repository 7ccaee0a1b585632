"""What of a client's messages goes to a vehicle now, by the policy table and what it does.

A client that streams setpoints must not drive the instant a task ends, and nobody but a person at
the sticks moves a vehicle that a task is driving.
"""

from collections.abc import Hashable
from math import isfinite

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.services.orders import moves

NO_PLACE = 7  # type_mask of what ignores x, y and z
STICKS_CENTRED = 50  # of ±1000 (MANUAL_CONTROL) or µs around 1500 (RC override)
RC_CENTRE = 1500
RC_IGNORED = (0, 65535)


def why_not_sent(row: Row, vehicle: Vehicle, client: Hashable, *, takes_over: bool = False) -> str:
    """Return in words what keeps a word of a client from a rover now, "" if nothing does.

    ``takes_over``: it also asks for the mode in which clients drive.
    """
    if row.needs_grant:
        return vehicle.motion_rights.why_not_moved(client, takes_over=takes_over)
    if not row.passes_beside_task:
        return vehicle.motion_rights.why_no_motion(takes_over=takes_over)
    if not row.passes_under_stop and vehicle.tasks.is_stopped:
        return "STOP is latched"
    return ""


def may_pass(
    vehicle: Vehicle,
    client: GcsClient,
    row: Row,
    message: m.Message | None,
) -> bool:
    """Whether a client's packet may be passed on to the vehicle; then ``passed`` is called."""
    # it may have waited for us while the vehicle stopped by itself
    if client.is_late and row.kind in (Kind.MOTION, Kind.STICKS) and not _asks_to_stand(message):
        return False
    if row.needs_grant and message is not None and not _is_finite(message):
        return False
    return not why_not_sent(row, vehicle, client.key)


def withheld(vehicle: Vehicle, client: Hashable, row: Row, *, now: float) -> None:
    """Note that a client's packet does not go to the vehicle."""
    if row.needs_grant:
        vehicle.motion_rights.withheld(client, now=now)


def passed(
    vehicle: Vehicle, client: Hashable, row: Row, message: m.Message | None, *, now: float
) -> None:
    """Note what a packet that goes to the vehicle means for its tasks."""
    if row.needs_grant:
        vehicle.motion_rights.passed(client, now=now)
    elif isinstance(message, m.ManualControl | m.RcChannelsOverride) and _off_centre(message):
        vehicle.joint.sticks_moved(now=now)


def _asks_to_stand(message: m.Message | None) -> bool:
    return (
        isinstance(message, m.SetPositionTargetLocalNed)
        and message.type_mask & NO_PLACE == NO_PLACE
        and not moves(message)
        and not any((message.afx, message.afy, message.afz))
    )


def _is_finite(message: m.Message) -> bool:
    """Whether no number in it would make an autopilot abort, even in a field that is ignored."""
    return all(
        isfinite(number)
        for value in message.to_dict().values()
        for number in (value if isinstance(value, list) else [value])
        if isinstance(number, float)
    )


def _off_centre(message: m.ManualControl | m.RcChannelsOverride) -> bool:
    """Whether a person moves the sticks, rather than resting at them."""
    if isinstance(message, m.ManualControl):
        sticks = (message.x, message.y, message.z, message.r)  # z is a rover's throttle
        return any(abs(s) > STICKS_CENTRED for s in sticks if s != 0x7FFF)
    channels = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
    return any(abs(c - RC_CENTRE) > STICKS_CENTRED for c in channels if c not in RC_IGNORED)
