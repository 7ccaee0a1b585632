"""The traffic of ROS 2's mavros 2.12 with its defaults, rebuilt from what its sources send.

Its address is that of an onboard computer inside the vehicle's own system, 1/191. It is connected
once the autopilot's heartbeat comes. Then it asks who that is (three times everybody, then the
autopilot), for home, after 10 s for all parameters, and after 15 s for the mission. It sends
TIMESYNC at 10 Hz. Arming has ``confirmation`` 1, and a mode is asked for by SET_MODE.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.shell.in_memory import CLIENT_LINK
from tests.kit.client import IDS, FakeClient, Received, Sent, command_long, set_mode
from tests.kit.mission import Download, Item, Upload
from tests.kit.world import World

ARM, CAPABILITIES, GET_HOME = 400, 520, 410
MISSION_WITHIN = 4.0  # s
VELOCITY = 0x05C7  # PositionTarget: ignores place, acceleration and yaw
BODY_NED = 8


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
        self._agenda: list[tuple[float, Callable[[], object]]] = []
        #: what it publishes as /mavros/state: connected, armed, custom_mode
        self.state = (False, False, 0)
        self._pulled: Download | None = None
        world.join(client)

    @property
    def waypoints(self) -> list[Any] | None:
        """What was pulled last; None until that is whole."""
        return self._pulled.items if self._pulled and self._pulled.is_done else None

    # services

    def arm(self, value: bool = True) -> Sent:
        """/mavros/cmd/arming."""
        return self.client.command(ARM, float(value), target=(1, 1), confirmation=1)

    def set_mode(self, mode: int) -> None:
        """/mavros/set_mode: it only says that it was sent."""
        self.client.send(set_mode(mode))

    def push(self, items: Sequence[Item]) -> bool:
        """/mavros/mission/push."""
        upload = Upload(self.client, items)
        self.world.until(lambda: upload.result is not None, within=MISSION_WITHIN)
        return upload.result == 0

    def pull(self) -> bool:
        """/mavros/mission/pull."""
        download = self._download()
        self.world.until(lambda: download.is_done or download.has_failed, within=MISSION_WITHIN)
        return download.is_done

    def velocity(self, forward: float) -> None:
        """/mavros/setpoint_raw/local at 20 Hz, in the rover's frame, from now on."""
        self.client.stream(
            common.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, BODY_NED, VELOCITY, 0, 0, 0, forward, 0, 0, 0, 0, 0, 0, 0
            ),
            rate=20,
        )

    # Role

    def next_deadline(self) -> float | None:
        return min((at for at, _ in self._agenda), default=None)

    def turn(self, *, now: float) -> None:
        for due in [each for each in self._agenda if each[0] <= now]:
            self._agenda.remove(due)
            due[1]()

    def take(self, packet: Received, *, now: float) -> None:
        if packet.message_id == IDS["HEARTBEAT"] and packet.source == (1, 1):
            if not self.state[0]:
                self._connected(now)
            beat = self.client.decoded(packet)
            self.state = (True, bool(beat.base_mode & 128), beat.custom_mode)

    def _download(self) -> Download:
        self._pulled = Download(self.client)
        return self._pulled

    def _connected(self, now: float) -> None:
        for after, message in (
            (1.0, command_long(CAPABILITIES, 1, target=(0, 0))),
            (2.0, command_long(CAPABILITIES, 1, target=(1, 1))),
            (10.0, common.MAVLink_param_request_list_message(1, 1)),
            (10.0, command_long(GET_HOME, target=(1, 1))),
        ):
            self._agenda.append((now + after, partial(self.client.send, message)))
        self._agenda.append((now + 15.0, self._download))
