"""Setpoints with a guard that keeps a checked vehicle from running away.

A setpoint other than zero is sent only while the last heartbeat is fresh and shows the vehicle
armed, in the control mode, and while it is within a few metres of its start. Every exit path calls
``bring_to_rest``.
"""

import math

from rover_sim.check_vehicle.context import Context
from rover_sim.check_vehicle.modes import ask_mode
from rover_sim.check_vehicle.probe import AUTOPILOT, HEARTBEAT
from rover_sim.check_vehicle.telemetry import ATTITUDE, LOCAL_POSITION_NED

ARM_DISARM = 400
LOCAL_NED, BODY_NED = 1, 8  # MAV_FRAME
VELOCITY, VELOCITY_AND_RATE, POSITION = 0x0DC7, 0x05C7, 0x0DF8  # type masks
PERIOD = 0.05  # s between two setpoints
FRESH = 2.5  # s, age of a heartbeat
FRESH_POSITION = 1.0  # s, age of a position
FARTHEST = 15.0  # m from its start
STANDING = 0.1  # m/s
REST_TRIES = 5


class Interference(Exception):
    """The vehicle must not be driven in its state; the message is one line."""


class DriveController:
    """Drives a vehicle with setpoints at 20 Hz."""

    def __init__(self, context: Context) -> None:
        self._probe = context.probe
        self._way = context.way
        position = self.position
        self._start = (position.x, position.y)

    def __repr__(self) -> str:
        return f"DriveController(from {self._start})"

    @property
    def position(self) -> "Position":
        """Reported position and speed. Raise Interference if a message is missing."""
        message = self._probe.last(LOCAL_POSITION_NED)
        attitude = self._probe.last(ATTITUDE)
        if message is None or attitude is None:
            raise Interference("no LOCAL_POSITION_NED, or no ATTITUDE")
        return Position(message.x, message.y, math.hypot(message.vx, message.vy), attitude.yaw)

    def velocity(
        self, vx: float, vy: float, seconds: float, *, frame: int, yaw_rate: float | None = None
    ) -> None:
        """Stream a velocity (m/s; rad/s) for ``seconds``."""
        mask = VELOCITY if yaw_rate is None else VELOCITY_AND_RATE
        values = (0.0, 0.0, 0.0, vx, vy, 0.0, 0.0, 0.0, 0.0, 0.0, yaw_rate or 0.0)
        self._stream(frame, mask, values, seconds, moves=(vx, vy, yaw_rate or 0.0) != (0, 0, 0))

    def zeros(self, seconds: float) -> None:
        """Stream zero velocity."""
        self.velocity(0.0, 0.0, seconds, frame=LOCAL_NED)

    def go_to(self, north: float, east: float, seconds: float) -> None:
        """Stream a position (m) for ``seconds``."""
        values = (north, east, *(0.0,) * 9)
        self._stream(LOCAL_NED, POSITION, values, seconds, moves=True)

    def wait_standing(self, within: float, *, silent: bool = False) -> float | None:
        """Return the seconds to standstill, with zeros or silent; None if still moving."""
        began = self._probe.now
        while self._probe.now - began < within:
            if silent:
                self._probe.listen(PERIOD)
            else:
                self.zeros(PERIOD)
            if self.position.speed < STANDING:
                return self._probe.now - began
        return None

    def _stream(
        self, frame: int, mask: int, values: tuple[float, ...], seconds: float, *, moves: bool
    ) -> None:
        end = self._probe.now + seconds
        while self._probe.now < end:
            if moves:
                self._guard()
            self._probe.send(
                self._probe.messages.set_position_target_local_ned_encode(
                    0, self._probe.system_id, AUTOPILOT, frame, mask, *values
                )
            )
            self._probe.listen(PERIOD)

    def _guard(self) -> None:
        probe = self._probe
        if probe.silence(HEARTBEAT) > FRESH:
            raise Interference(f"no heartbeat for {FRESH:g} s")
        if probe.silence(LOCAL_POSITION_NED) > FRESH_POSITION:
            raise Interference(f"no LOCAL_POSITION_NED for {FRESH_POSITION:g} s")
        if not probe.armed:
            raise Interference("it is not armed any more")
        if probe.custom_mode != self._way.control:
            raise Interference(f"it left the control mode, for {probe.custom_mode:#x}")
        position = self.position
        if math.dist(self._start, (position.x, position.y)) > FARTHEST:
            raise Interference(f"it is {FARTHEST:g} m away")


class Position:
    """Reported position, speed and yaw of a vehicle."""

    __slots__ = ("speed", "x", "y", "yaw")

    def __init__(self, x: float, y: float, speed: float, yaw: float) -> None:
        self.x, self.y, self.speed, self.yaw = x, y, speed, yaw

    def ahead_of(self, other: "Position") -> float:
        """Return the distance ahead of ``other``, along its heading, m."""
        return (self.x - other.x) * math.cos(other.yaw) + (self.y - other.y) * math.sin(other.yaw)

    def distance_to(self, other: "Position") -> float:
        """Return the distance between two positions, m."""
        return math.hypot(self.x - other.x, self.y - other.y)


def bring_to_rest(context: Context) -> bool:
    """Send zeros, HOLD and disarm until shown; return success. Runs on Ctrl-C, too."""
    probe, way = context.probe, context.way
    for _ in range(REST_TRIES):
        for _ in range(3):
            probe.send(
                probe.messages.set_position_target_local_ned_encode(
                    0, probe.system_id, AUTOPILOT, LOCAL_NED, VELOCITY, *(0.0,) * 11
                )
            )
        ask_mode(context, way.hold)
        probe.command(ARM_DISARM, 0)
        probe.wait(HEARTBEAT, 1.5, since=probe.mark())
        if probe.custom_mode == way.hold and not probe.armed:
            return True
    return False
