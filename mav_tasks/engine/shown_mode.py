"""The mode that clients are shown for a moment in place of the vehicle's own.

A ground station that asks for a mode waits until a heartbeat shows it. What the server does itself
instead, a mission or a return, the vehicle would never show.
"""

from math import inf

from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.messages import Heartbeat
from mav_tasks.mavlink.packet import Packet, with_payload

CUSTOM_MODE = 0  # where it is in HEARTBEAT's payload
BYTES = 4


class ShownMode:
    """What the heartbeats of one vehicle say towards clients."""

    def __init__(self) -> None:
        self._mode = 0
        self._until = -inf

    def __repr__(self) -> str:
        return f"ShownMode({self._mode}, until={self._until:.2f})"

    def show(self, mode: int, *, until: float) -> None:
        """Show a custom_mode for a while."""
        self._mode, self._until = mode, until

    def forget(self) -> None:
        """Show the vehicle's own again."""
        self._until = -inf

    def in_message(self, heartbeat: Heartbeat, *, now: float) -> Heartbeat:
        """Give a copy of a heartbeat's message as clients are to see it."""
        mode = self._mode if now < self._until else heartbeat.custom_mode
        return Heartbeat(
            type=heartbeat.type,
            autopilot=heartbeat.autopilot,
            base_mode=heartbeat.base_mode,
            custom_mode=mode,
            system_status=heartbeat.system_status,
            mavlink_version=heartbeat.mavlink_version,
        )

    def applied(self, packet: Packet, *, now: float) -> Packet:
        """Give a packet of the vehicle as clients are to see it."""
        if now >= self._until:
            return packet
        if packet.message_id != Heartbeat.id or packet.component_id != AUTOPILOT:
            return packet
        return with_payload(packet, CUSTOM_MODE, self._mode.to_bytes(BYTES, "little"))
