"""Decides whether a client's message goes to a vehicle now, by policy table and vehicle state.

A client that streams setpoints must not drive the instant a task ends. While a task drives a
vehicle, only manual control moves it.
"""

from collections.abc import Hashable, Iterable
from math import isfinite
from typing import Any

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.policy import Kind, Row
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.services.orders import moves
from mav_tasks.services.phase import Phase
from mav_tasks.tasks.lifecycle import STOP_IN_FORCE

NO_PLACE = 7  # type_mask that ignores x, y and z
STICKS_CENTRED = 50  # of ±1000 (MANUAL_CONTROL) or µs around 1500 (RC override)
RC_CENTRE = 1500
RC_IGNORED = (0, 65535)
#: the one reason why the setpoints of a client do not pass that may drive
UNARMED = "the rover is not armed"


def why_not_moved(parts: Parts, client: Hashable, *, takes_over: bool = False) -> str:
    """Return why a client's motion message may not pass, in words, or "" if it may.

    ``takes_over``: the client also asks for the mode in which clients drive.
    """
    why_not = why_no_motion(parts, takes_over=takes_over)
    if why_not:
        return why_not
    if parts.tasks.is_driving:  # also one that is paused
        return "not during a task"
    if not takes_over and not parts.authority.has_granted(client):
        return f"set {parts.persona.mode_name(parts.persona.control_mode)} first"
    return "" if parts.monitor.armed else UNARMED


def why_no_motion(parts: Parts, *, takes_over: bool = False) -> str:
    """Return why no client may move it now, in words, or "" if one may.

    With ``takes_over``, the client may continue from where we hand the vehicle back.
    """
    if parts.tasks.is_stopped:
        return STOP_IN_FORCE
    if parts.control.is_engaged and not (takes_over and parts.control.phase is Phase.RELEASING):
        return "not during a task"
    if parts.control.awaits_mode:
        return "the server is setting HOLD"
    return ""


def why_not_sent(row: Row, vehicle: Vehicle, client: Hashable, *, takes_over: bool = False) -> str:
    """Return why a client's message may not go to a rover now, "" if it may.

    ``takes_over``: it also asks for the mode in which clients drive.
    """
    if row.needs_grant:
        return why_not_moved(vehicle.parts, client, takes_over=takes_over)
    if not row.passes_beside_task:
        return why_no_motion(vehicle.parts, takes_over=takes_over)
    if not row.passes_under_stop and vehicle.tasks.is_stopped:
        return STOP_IN_FORCE
    return ""


def may_pass(
    vehicle: Vehicle,
    client: GcsClient,
    row: Row,
    message: m.Message | None,
) -> bool:
    """Whether a client's packet may be forwarded to the vehicle; if so, call ``passed``."""
    # it may have waited here while the vehicle stopped by itself
    if client.is_late and row.kind in (Kind.MOTION, Kind.STICKS) and not _asks_to_stand(message):
        return False
    if row.needs_grant and message is not None and not _is_finite(message):
        return False
    return not why_not_sent(row, vehicle, client.key)


def passed(
    vehicle: Vehicle, client: GcsClient, row: Row, message: m.Message | None, *, now: float
) -> None:
    """Note the effect on the tasks of a packet that is forwarded to the vehicle."""
    if row.needs_grant:
        vehicle.parts.authority.note_client(client.key, now=now)
    elif isinstance(message, m.ManualControl | m.RcChannelsOverride) and _off_centre(message):
        vehicle.joint.sticks_moved(actor=str(client.who), now=now)


def _asks_to_stand(message: m.Message | None) -> bool:
    return (
        isinstance(message, m.SetPositionTargetLocalNed)
        and message.type_mask & NO_PLACE == NO_PLACE
        and not moves(message)
        and not any((message.afx, message.afy, message.afz))
    )


def _is_finite(message: m.Message) -> bool:
    """Whether all numbers are finite: others make autopilots abort, even in ignored fields."""
    values: Iterable[Any] = message.to_dict().values()  # arrays, too, which pymavlink does not say
    return all(
        isfinite(number)
        for value in values
        for number in (value if isinstance(value, list) else [value])
        if isinstance(number, float)
    )


def _off_centre(message: m.ManualControl | m.RcChannelsOverride) -> bool:
    """Whether a stick is off its centre: a person drives."""
    if isinstance(message, m.ManualControl):
        sticks = (message.x, message.y, message.z, message.r)  # z is a rover's throttle
        return any(abs(s) > STICKS_CENTRED for s in sticks if s != 0x7FFF)
    channels = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
    return any(abs(c - RC_CENTRE) > STICKS_CENTRED for c in channels if c not in RC_IGNORED)
