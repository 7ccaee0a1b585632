"""Which of a client's messages may move a vehicle, and when.

A client that streams setpoints must not drive the instant a task ends, and nobody but a person at
the sticks moves a vehicle that a task is driving.
"""

from collections.abc import Hashable
from math import isfinite

from mav_tasks.engine.vehicles.vehicle import Vehicle
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.orders import moves

#: drive the vehicle: pass only for a client that has control of it
MOTION = (
    m.SetPositionTargetLocalNed,
    m.SetPositionTargetGlobalInt,
    m.SetAttitudeTarget,
    m.SetActuatorControlTarget,
    m.FollowTarget,
    m.MissionItem,  # with current = 2 it is ArduPilot's "go to"
    m.MissionItemInt,
)
NO_PLACE = 7  # type_mask of what ignores x, y and z
#: the same, of kinds that are no messages here: inputs of a radio or of a simulator, of which it is
#: not looked at what they say
RAW_MOTION = frozenset(
    {
        65,  # RC_CHANNELS, an input of PX4
        81,  # MANUAL_SETPOINT
        91,  # HIL_CONTROLS
        92,  # HIL_RC_INPUTS_RAW
        93,  # HIL_ACTUATOR_CONTROLS
        420,  # RADIO_RC_CHANNELS
    }
)
#: what may pass while STOP is latched: what asks, what tells, and what is set for later
MOTIONLESS = frozenset(
    {
        *(m.Heartbeat.id, m.SystemTime.id, m.Ping.id, m.Timesync.id, m.Statustext.id),
        *(m.ParamRequestRead.id, m.ParamRequestList.id, m.ParamSet.id),
        *(m.MissionRequestList.id, m.MissionRequest.id, m.MissionRequestInt.id, m.MissionAck.id),
        *(m.FileTransferProtocol.id, m.CommandAck.id),
        *(117, 119, 121, 122),  # LOG_REQUEST_LIST, _DATA, LOG_ERASE, LOG_REQUEST_END
        *(320, 321, 323),  # PARAM_EXT_REQUEST_READ, _LIST, PARAM_EXT_SET
        *(109, 233),  # RADIO_STATUS, GPS_RTCM_DATA
    }
)
GO_TO = (2, 3)  # MISSION_ITEM.current: go there now, at once or to this altitude
STICKS_CENTRED = 50  # of ±1000 (MANUAL_CONTROL) or µs around 1500 (RC override)
RC_CENTRE = 1500
RC_IGNORED = (0, 65535)


def may_pass(
    vehicle: Vehicle,
    client: Hashable,
    packet: Packet,
    message: m.Message | None,
    *,
    is_old: bool = False,
) -> bool:
    """Whether a client's packet may be passed on to the vehicle; then ``passed`` is called.

    ``is_old``: it may have waited for us while the vehicle stopped by itself.
    """
    if _moves(packet, message):
        if is_old and not _asks_to_stand(message):
            return False
        return (message is None or _is_finite(message)) and vehicle.may_move(client)
    if is_old and isinstance(message, m.ManualControl | m.RcChannelsOverride):
        return not _off_centre(message)
    return packet.message_id in MOTIONLESS or not vehicle.tasks.is_stopped


def withheld(
    vehicle: Vehicle, client: Hashable, packet: Packet, message: m.Message | None, *, now: float
) -> None:
    """Note that a client's packet does not go to the vehicle."""
    if _moves(packet, message):
        vehicle.is_not_moved_by(client, now=now)


def passed(
    vehicle: Vehicle, client: Hashable, packet: Packet, message: m.Message | None, *, now: float
) -> None:
    """Note what a packet that goes to the vehicle means for its tasks."""
    if _moves(packet, message):
        vehicle.is_moved_by(client, now=now)
    elif isinstance(message, m.ManualControl | m.RcChannelsOverride) and _off_centre(message):
        vehicle.sticks_moved(now=now)


def _moves(packet: Packet, message: m.Message | None) -> bool:
    if packet.message_id in RAW_MOTION:
        return True
    if isinstance(message, m.MissionItem | m.MissionItemInt):
        return message.current in GO_TO  # or else it is part of an upload
    return isinstance(message, MOTION)


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
