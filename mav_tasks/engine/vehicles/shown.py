"""What one vehicle shows: its heartbeats as clients see them, PX4's checks, and its sticks.

The mode may differ for a moment. A ground station that asks for a mode waits until a heartbeat
shows it. If the server does the job itself, a mission or a return, the vehicle would never show it.

Armed is shown as active. An ArduPilot that stands armed in HOLD reports standby, and ground
stations then hide what an operator may have it do next. Under STOP that is right: nothing of it
works, and QGroundControl has room for "Continue" beside "STOP".

PX4 reports (EVENT) that no mission can start, because the server keeps the missions, and
QGroundControl then hides "Start mission". The server drives one wherever PX4 could stand in Hold.

An ArduPilot in GUIDED takes the throttle stick as a speed of its own (1.9 m/s were measured where 0
was asked for), and only RC_CHANNELS shows that. Neutral is what the sticks show while the vehicle
is disarmed: a throttle may rest at its lowest, and a vehicle cannot be armed while its throttle is
held forward. While the vehicle is armed, a stick may be held, even if nothing drives.
"""

from copy import copy
from math import inf

from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavModeFlag, MavState
from mav_tasks.mavlink.messages import Event, Heartbeat, RcChannels
from mav_tasks.mavlink.packet import Packet, with_payload
from mav_tasks.tasks.halts import Halts, Permit

#: offsets in the payload of HEARTBEAT
CUSTOM_MODE, BASE_MODE, SYSTEM_STATUS = 0, 6, 7
BYTES = 4  # of custom_mode
#: PX4's event "commander_arming_check_summary": 24 bits of the name's FNV-1a, then its component
ARMING_CHECKS = b"\xe0\x93\xa8\x01"
CAN_ARM = 22  # offset in its payload: the modes in which PX4 could be armed
MISSION, LOITER = 8, 16
REWRITTEN = frozenset({Event.id, Heartbeat.id})


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
        """Return a packet of the vehicle, one that is REWRITTEN, as clients see it."""
        if packet.message_id == Event.id:
            return _with_mission(packet)
        if packet.component_id != AUTOPILOT:
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


LEAVES = 100  # µs from neutral; trims and noise are a tenth of that
TIMES = 2  # messages in a row that must show it
ABSENT = (0, 65535)  # values of a channel that is absent
FRESH = 0.5  # s, of five messages at the requested rate; an older value is unknown


class StickWatch:
    """The sticks of one vehicle: steering and throttle at the RCMAP_* defaults."""

    def __init__(self) -> None:
        self._said_at = -inf
        self.forget()

    def __repr__(self) -> str:
        return f"StickWatch(rest={self._rest})"

    def forget(self) -> None:
        """Forget neutral after a restart of the vehicle: its transmitter may be another one."""
        self._rest: tuple[int, int] | None = None
        self._times = self._throttle = 0

    def throttle(self, *, now: float) -> int:
        """Return 1 while the throttle is held forward of neutral, -1 while held back, else 0.

        The signs are swapped if the vehicle reverses the channel.
        """
        return self._throttle if now - self._said_at <= FRESH else 0

    def look(self, message: RcChannels, *, armed: bool, sent_at: float) -> bool:
        """Return whether a stick is off neutral; learn neutral while the vehicle is disarmed."""
        here, self._said_at = (message.chan1_raw, message.chan3_raw), sent_at
        if not message.chancount or any(value in ABSENT for value in here):
            self._times = self._throttle = 0
            return False
        if self._rest is None or not armed:
            self._rest, self._times, self._throttle = here, 0, 0
            return False
        steered, off = here[0] - self._rest[0], here[1] - self._rest[1]
        self._throttle = (off > LEAVES) - (off < -LEAVES)
        self._times = self._times + 1 if self._throttle or abs(steered) > LEAVES else 0
        return self._times >= TIMES
