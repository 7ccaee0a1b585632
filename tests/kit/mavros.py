"""The traffic of ROS 2's mavros 2.12 with its defaults, rebuilt from what its sources send.

Its address is that of an onboard computer inside the vehicle's own system, 1/191. It is connected
once the autopilot's heartbeat comes. Then it asks who that is (three times everybody, then the
autopilot), for home, after 10 s for all parameters, and after 15 s for the mission. It sends
TIMESYNC at 10 Hz. Arming has ``confirmation`` 1, and a mode is asked for by SET_MODE.
"""

import struct
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.in_memory import CLIENT_LINK
from tests.kit.client import IDS, FakeClient, Received, Sent, command_long, set_mode
from tests.kit.mission import COUNT, ITEM_INT, MISSION_ACK, REQUEST, REQUEST_INT, Item
from tests.kit.world import World

ONBOARD_COMPUTER = 191
ARM, CAPABILITIES, GET_HOME = 400, 520, 410
ACK_TIMEOUT = 5.0  # s
WAYPOINTS_TIMEOUT, WAYPOINTS_TRIES = 1.0, 4  # s; a message, and three repeats
VELOCITY = 0x05C7  # PositionTarget: ignores place, acceleration and yaw
VELOCITY_NED, BODY_NED = 0x0DC7, 8


def heartbeat() -> Any:
    """Return its heartbeat: an armed onboard controller, whatever the rover is."""
    return common.MAVLink_heartbeat_message(18, 8, 192, 0, 4, 3)


class Mavros:
    """One mavros node."""

    def __init__(
        self, world: World, name: str = "mavros", *, server: str = CLIENT_LINK, component: int = 191
    ) -> None:
        self.world = world
        self.client = client = FakeClient(
            world.net,
            name,
            system_id=1,
            component_id=component,
            server=server,
            heartbeats=False,
            reads_dialect=False,
        )
        client.stream(heartbeat(), rate=1)
        client.stream(common.MAVLink_timesync_message(0, 1), rate=10)
        client.stream(common.MAVLink_system_time_message(1, 1), rate=1)
        client.roles.append(self)
        self._agenda: list[tuple[float, Any]] = []
        #: what it publishes as /mavros/state: connected, armed, custom_mode
        self.state = (False, False, 0)
        self.waypoints: list[Any] | None = None
        self.sent_waypoints: Sequence[Item] = ()
        #: of the last push, pull or clear: whether it went well; None while it goes on
        self.success: bool | None = None
        self._expects = 0
        world.join(client)

    # services

    def arm(self, value: bool = True) -> Sent:
        """/mavros/cmd/arming."""
        return self.client.command(ARM, float(value), target=(1, 1), confirmation=1)

    def set_mode(self, mode: int) -> None:
        """/mavros/set_mode: it only says that it was sent."""
        self.client.send(set_mode(mode))

    def push(self, items: Sequence[Item]) -> bool:
        """/mavros/mission/push."""
        self.sent_waypoints = items
        return self._mission(common.MAVLink_mission_count_message(1, 1, len(items), 0))

    def pull(self) -> bool:
        """/mavros/mission/pull."""
        self.waypoints = None
        return self._mission(common.MAVLink_mission_request_list_message(1, 1, 0))

    def velocity(self, forward: float) -> None:
        """/mavros/setpoint_raw/local at 20 Hz, in the rover's frame, from now on."""
        self.client.stream(
            common.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, BODY_NED, VELOCITY, 0, 0, 0, forward, 0, 0, 0, 0, 0, 0, 0
            ),
            rate=20,
        )

    def _mission(self, message: Any) -> bool:
        self.success = None
        for _ in range(WAYPOINTS_TRIES):
            self.client.send(message)
            end = self.world.now + WAYPOINTS_TIMEOUT
            while self.world.now < end and self.success is None:
                self.world.run(0.02)
            if self.success is not None:
                return self.success
        return False

    # Role

    def next_deadline(self) -> float | None:
        return min((at for at, _ in self._agenda), default=None)

    def turn(self, *, now: float) -> None:
        for due in [each for each in self._agenda if each[0] <= now]:
            self._agenda.remove(due)
            self.client.send(due[1])

    def take(self, packet: Received, *, now: float) -> None:
        if packet.source[0] != 1:  # it takes whatever comes from the target system
            return
        if packet.message_id == IDS["HEARTBEAT"] and packet.source == (1, 1):
            if not self.state[0]:
                self._connected(now)
            beat = self.client.decoded(packet)
            self.state = (True, bool(beat.base_mode & 128), beat.custom_mode)
        elif packet.message_id == COUNT and self.success is None:
            (self._expects,) = struct.unpack("<H", packet.payload.ljust(2, b"\0")[:2])
            self.waypoints = []
            self._ask_next()
        elif packet.message_id == ITEM_INT and self.waypoints is not None:
            item = self.client.decoded(packet)
            if item.seq == len(self.waypoints):
                self.waypoints.append(item)
                self._ask_next()
        elif packet.message_id in (REQUEST, REQUEST_INT) and self.success is None:
            (seq,) = struct.unpack("<H", packet.payload.ljust(2, b"\0")[:2])
            self.client.send(self.sent_waypoints[seq].message(seq, 0, (1, 1)))
        elif packet.message_id == MISSION_ACK and self.success is None:
            self.success = packet.payload.ljust(4, b"\0")[2] == 0

    def _ask_next(self) -> None:
        assert self.waypoints is not None
        if len(self.waypoints) < self._expects:
            seq = len(self.waypoints)
            self.client.send(common.MAVLink_mission_request_int_message(1, 1, seq, 0))
        else:
            self.client.send(common.MAVLink_mission_ack_message(1, 1, 0, 0))
            self.success = True

    def _connected(self, now: float) -> None:
        everybody = command_long(CAPABILITIES, 1, target=(0, 0))
        autopilot = command_long(CAPABILITIES, 1, target=(1, 1))
        self._agenda += [(now + 1.0 + n, each) for n, each in enumerate((everybody, autopilot))]
        self._agenda += [
            (now + 10.0, common.MAVLink_param_request_list_message(1, 1)),
            (now + 10.0, command_long(GET_HOME, target=(1, 1))),
            (now + 15.0, common.MAVLink_mission_request_list_message(1, 1, 0)),
        ]
