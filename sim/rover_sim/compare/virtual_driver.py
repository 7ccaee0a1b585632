"""Drives a simulated rover in virtual time, with MAVLink over a memory net, without a task server.

The other end of the link is pymavlink, so the figures show what any client would see.
"""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mav

from mav_tasks.links.memory import Conditions, MemoryNet
from rover_sim.compare.driver import Step
from rover_sim.compare.trace import Heard, Mark, Trace, TruePose
from rover_sim.vehicle import Vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

ROVER_LINK = "rover"
SETPOINT_PERIOD = 0.05  # s, 20 Hz
STICK_PERIOD = 0.1  # s between two RC_CHANNELS_OVERRIDE
PLACES_PERIOD = 2.0  # s between two requests of home and origin
RATES_PERIOD = 20.0  # s between two requests of rates: a restarted rover has lost them
FAST_US = {True: 20_000, False: 25_000}  # µs; PX4: 50 Hz, ArduPilot: 40 Hz, its maximum
SLOW_US = 200_000
TIMEOUT = 1.0  # s for an acknowledgement
VELOCITY, VELOCITY_AND_YAW_RATE = 0x0DC7, 0x05C7  # type_mask
UNTOUCHED = 65535  # an override ignores the channel
OFFBOARD, PX4_HOLD = (6, 0), (4, 3)  # main and sub mode
GUIDED, ARDUPILOT_HOLD = (15, 0), (4, 0)
FAST = (mav.MAVLINK_MSG_ID_ATTITUDE, mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
SLOW = (
    mav.MAVLINK_MSG_ID_SYS_STATUS,
    mav.MAVLINK_MSG_ID_GPS_RAW_INT,
    mav.MAVLINK_MSG_ID_RC_CHANNELS,
    mav.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
)
PLACES = (mav.MAVLINK_MSG_ID_HOME_POSITION, mav.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
NEVER = math.inf
LOOPBACK = Conditions(delay=0.0001)  # s each way; the real rovers were recorded on one machine


class VirtualDriver:
    """Implements ``Driver`` as a party of the virtual world; ``trace`` has the result."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.trace = Trace()
        self._vehicle = vehicle
        net = MemoryNet(conditions=LOOPBACK)
        self._link = net.link("driver")
        self._world = VirtualWorld(net)
        self._world.join(RoverParty(vehicle, net.link(ROVER_LINK)), self)
        self._world.watch(self._note_pose)
        self._mav = mav.MAVLink(self, srcSystem=255, srcComponent=190)
        self._last: dict[str, Any] = {}
        self._throttle: int | None = None
        self._due: dict[Callable[[], None], float] = {
            self._send_heartbeat: 0.0,
            self._ask_for_rates: NEVER,
            self._ask_for_places: NEVER,
            self._send_stick: NEVER,
        }

    def write(self, data: bytes) -> None:
        """Send bytes; pymavlink calls this on its file object."""
        self._link.send(ROVER_LINK, bytes(data))

    # as a party of the world

    def next_deadline(self) -> float:
        """Return the time of the next message to send."""
        return min(self._due.values())

    def turn(self, *, now: float) -> None:
        """Read received messages and send those that are due."""
        for _, data in self._link.receive(len(self._link.arrived)):
            self._take(self._mav.decode(bytearray(data)))  # a datagram is one whole packet
        for send, at in self._due.items():
            if at <= now:
                send()

    def _take(self, message: Any) -> None:
        name = message.get_type()
        if name == "HEARTBEAT" and name not in self._last:
            self._due[self._ask_for_rates] = self._due[self._ask_for_places] = self._world.now
        self._last[name] = message
        self.trace.heard.setdefault(name, []).append(Heard(self._world.now, message))

    def _note_pose(self, _now: float) -> None:
        state = self._vehicle.truth
        poses = self.trace.poses
        if not poses or state.time > poses[-1].time:
            speed = state.forward_speed
            pose = TruePose(state.time, state.north, state.east, state.yaw, speed, state.yaw_rate)
            poses.append(pose)

    # periodic messages

    def _send_heartbeat(self) -> None:
        self._mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 4)
        self._due[self._send_heartbeat] = self._world.now + 1.0

    def _ask_for_places(self) -> None:
        for message_id in PLACES:
            self._command(mav.MAV_CMD_REQUEST_MESSAGE, message_id)
        self._due[self._ask_for_places] = self._world.now + PLACES_PERIOD

    def _ask_for_rates(self) -> None:
        for message_id in FAST:
            self._command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, FAST_US[self.is_px4])
        for message_id in SLOW:
            self._command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, SLOW_US)
        self._due[self._ask_for_rates] = self._world.now + RATES_PERIOD

    def _send_stick(self) -> None:
        throttle = 0 if self._throttle is None else self._throttle  # 0 releases the channel
        channels = [UNTOUCHED, UNTOUCHED, throttle] + [UNTOUCHED] * 5
        self._mav.rc_channels_override_send(self._system, 1, *channels)
        again = NEVER if self._throttle is None else self._world.now + STICK_PERIOD
        self._due[self._send_stick] = again

    def _command(self, number: int, *parameters: float) -> None:
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        message = self._mav.command_long_encode(self._system, 1, number, 0, *values)
        self.trace.sent.setdefault("COMMAND_LONG", []).append(Heard(self._world.now, message))
        self._mav.send(message)

    def _ask(self, number: int, *parameters: float) -> bool:
        """Send a command; return whether it was accepted in time."""
        answers = self.trace.heard.setdefault("COMMAND_ACK", [])
        seen = len(answers)

        def result() -> int | None:
            new = (each.message for each in answers[seen:])
            return next((int(ack.result) for ack in new if ack.command == number), None)

        self._command(number, *parameters)
        self._world.run_until(lambda: result() is not None, within=TIMEOUT)
        return bool(result() == mav.MAV_RESULT_ACCEPTED)

    # as a Driver

    @property
    def _system(self) -> int:
        return int(self._last["HEARTBEAT"].get_srcSystem())

    @property
    def is_px4(self) -> bool:
        """Whether the rover is a PX4."""
        return bool(self._last["HEARTBEAT"].autopilot == mav.MAV_AUTOPILOT_PX4)

    @property
    def is_armed(self) -> bool:
        """Whether the last HEARTBEAT shows the rover armed."""
        return bool(self._last["HEARTBEAT"].base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def is_ready(self) -> bool:
        """Whether the rover is armed and follows setpoints."""
        custom = self._last["HEARTBEAT"].custom_mode
        in_control = custom >> 16 & 0xFF == OFFBOARD[0] if self.is_px4 else custom == GUIDED[0]
        return self.is_armed and bool(in_control)

    @property
    def reported_speed(self) -> float:
        """Speed that the rover last reported, m/s."""
        position = self._last["LOCAL_POSITION_NED"]
        return math.hypot(position.vx, position.vy)

    def mark(self, name: str) -> None:
        """Record the start of a manoeuvre."""
        self.trace.marks.append(Mark(self._world.now, name))

    def wait(self, seconds: float) -> None:
        """Let time pass without setpoints."""
        self._world.run(seconds)

    def wait_for_rover(self) -> None:
        """Let time pass until the rover is heard."""
        self._world.run_until(lambda: "HEARTBEAT" in self._last, within=60.0)

    def drive(self, seconds: float, step: Step) -> None:
        """Stream the step's setpoint; a PX4 rover gets it relative to its present heading."""
        begin = self._world.now
        course = self._last["ATTITUDE"].yaw + step.aside
        for count in range(round(seconds / SETPOINT_PERIOD)):
            self._send_setpoint(step, course + step.yaw_rate * count * SETPOINT_PERIOD)
            self._world.run(begin + (count + 1) * SETPOINT_PERIOD - self._world.now)

    def _send_setpoint(self, step: Step, course: float) -> None:
        if self.is_px4:
            frame, mask = mav.MAV_FRAME_LOCAL_NED, VELOCITY
            vx, vy = step.speed * math.cos(course), step.speed * math.sin(course)
        else:
            frame, mask = mav.MAV_FRAME_BODY_NED, VELOCITY_AND_YAW_RATE
            vx, vy = step.speed, 0.0
        rate = 0.0 if self.is_px4 else step.yaw_rate
        place = self._system, 1, frame, mask, 0.0, 0.0, 0.0
        message = self._mav.set_position_target_local_ned_encode(
            round(self._world.now * 1000), *place, vx, vy, 0.0, 0.0, 0.0, 0.0, 0.0, rate
        )
        stamped = Heard(self._world.now, message)
        self.trace.sent.setdefault("SET_POSITION_TARGET_LOCAL_NED", []).append(stamped)
        self._mav.send(message)

    def take_control(self) -> bool:
        """Request the mode that follows setpoints; return whether it was accepted."""
        return self._ask(mav.MAV_CMD_DO_SET_MODE, 1.0, *(OFFBOARD if self.is_px4 else GUIDED))

    def hold(self) -> bool:
        """Request HOLD; return whether it was accepted."""
        return self._ask(
            mav.MAV_CMD_DO_SET_MODE, 1.0, *(PX4_HOLD if self.is_px4 else ARDUPILOT_HOLD)
        )

    def arm(self) -> bool:
        """Request arming; return whether it was accepted."""
        return self._ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def disarm(self) -> bool:
        """Request disarming; return whether it was accepted."""
        return self._ask(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)

    def push_stick(self, throttle: int | None) -> None:
        """Hold the throttle at a pulse (µs) by RC_CHANNELS_OVERRIDE; None releases it."""
        self._throttle = throttle
        self._send_stick()
