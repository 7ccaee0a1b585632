"""The heartbeats of one vehicle as clients see them, its own with two changes; and PX4's checks.

The mode may differ for a moment. A ground station that asks for a mode waits until a heartbeat
shows it. If the server does the job itself, a mission or a return, the vehicle would never show it.

Armed is shown as active. An ArduPilot that stands armed in HOLD reports standby, and ground
stations then hide what an operator may have it do next. Under STOP that is right: nothing of it
works, and QGroundControl has room for "Continue" beside "STOP".

PX4 reports (EVENT) that no mission can start, because the server keeps the missions, and
QGroundControl then hides "Start mission". The server drives one wherever PX4 could stand in Hold.
"""

from copy import copy

from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavModeFlag, MavState
from mav_tasks.mavlink.messages import Event, Heartbeat
from mav_tasks.mavlink.packet import Packet, with_payload
from mav_tasks.tasks.halts import Halts
from mav_tasks.tasks.permit import Permit

#: offsets in the payload of HEARTBEAT
CUSTOM_MODE, BASE_MODE, SYSTEM_STATUS = 0, 6, 7
BYTES = 4  # of custom_mode
#: PX4's event "commander_arming_check_summary": 24 bits of the name's FNV-1a, then its component
ARMING_CHECKS = b"\xe0\x93\xa8\x01"
CAN_ARM = 22  # offset in its payload: the modes in which PX4 could be armed
MISSION, LOITER = 8, 16


class ShownHeartbeat:
    """Rewrites the heartbeats of one vehicle for clients."""

    def __init__(self, halts: Halts) -> None:
        #: the custom_mode to be shown in place of the vehicle's own
        self.mode = Permit[int](halts)

    def __repr__(self) -> str:
        return f"ShownHeartbeat({self.mode!r})"

    def in_message(self, heartbeat: Heartbeat, mode: int) -> Heartbeat:
        """Return a copy of a heartbeat message with the mode to be shown."""
        shown = copy(heartbeat)
        shown.custom_mode = mode
        shown.system_status = _status(heartbeat.base_mode, heartbeat.system_status)
        return shown

    def applied(self, packet: Packet, *, is_stopped: bool, now: float) -> Packet:
        """Return a packet of the vehicle as clients see it."""
        if packet.message_id == Event.id:
            return _with_mission(packet)
        if packet.message_id != Heartbeat.id or packet.component_id != AUTOPILOT:
            return packet
        payload = packet.payload
        if len(payload) > SYSTEM_STATUS and not is_stopped:
            status = _status(payload[BASE_MODE], payload[SYSTEM_STATUS])
            if status != payload[SYSTEM_STATUS]:
                packet = with_payload(packet, SYSTEM_STATUS, bytes((status,)))
        if (mode := self.mode.holder(now=now)) is not None:
            packet = with_payload(packet, CUSTOM_MODE, mode.to_bytes(BYTES, "little"))
        return packet


def _status(base_mode: int, status: int) -> int:
    is_armed = base_mode & MavModeFlag.SAFETY_ARMED
    return MavState.ACTIVE if is_armed and status == MavState.STANDBY else status


def _with_mission(packet: Packet) -> Packet:
    """Return a report of PX4's checks that allows a mission if it allows Hold."""
    modes = packet.payload[CAN_ARM : CAN_ARM + 1]  # none if zeros at the end were left out
    if packet.payload[:4] != ARMING_CHECKS or not modes or not modes[0] & LOITER:
        return packet
    return with_payload(packet, CAN_ARM, bytes((modes[0] | MISSION,)))
