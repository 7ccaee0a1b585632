"""PX4 1.17's rover controllers and their vehicles: a differential and an Ackermann rover.

Their gains and limits are parameters (RO_*). Recorded on a differential rover whose wheels follow
within 0.08 s, as this simulator's do, and on PX4's own Ackermann rover (SIH), which friction holds
below a quarter of the throttle.
"""

import math

from rover_sim.frames import Frame
from rover_sim.motion import CONTROL_PERIOD, YawControl, clipped, toward
from rover_sim.onboard import Onboard
from rover_sim.steering import Demand, Output

MANY = 1000.0  # m/s² or rad/s²: for a limit parameter of 0 or less, which means none
# SIH's vehicle, per kg: 20 N at full throttle; the force to break away; rolling friction; drag.
# Friction and drag are fitted: 1.37, 2.50 and 3.25 m/s for 1, 2 and 3 m/s demanded.
THRUST, BREAKAWAY, FRICTION, DRAG = 20.0, 4.9, 3.57, 1.43  # m/s², m/s², m/s², 1/m
YAW_INTEGRAL = 1.0  # 1/s; recorded: no oscillation after a turn at 195 deg/s; more would cause it
DEAD_TIME = 8  # control periods, from setpoint to thrust
ROLLED_OUT = 0.03  # m/s
FLT_EPSILON = 1.1920929e-7  # m/s demanded; below it the speed loop is off and resets its integral
FREE_ROLLING = 2.0  # s, disarmed. SIH's rolls on for ever, which is an artefact of its model


class DifferentialDrive:
    """Feed-forward to wheels that follow exactly.

    Disarmed, it stops at once, as geared motors without current do; in HOLD it brakes at the limit.
    """

    def __init__(self, on: Onboard) -> None:
        self._on = on
        values = on.parameters  # deg/s, deg/s²
        rate = math.radians(values["RO_YAW_RATE_LIM"])
        up, down = (math.radians(_limit(values[f"RO_YAW_{way}_LIM"])) for way in ("ACCEL", "DECEL"))
        self._yaw = YawControl(rate, up, down, YAW_INTEGRAL)
        self._speed = 0.0

    def step(self, demand: Demand) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period."""
        measured = self._on.estimate.yaw_rate
        if demand.output is Output.OFF:
            self._speed = 0.0
            return 0.0, self._yaw.step(0.0, measured, rolls=False)
        self._speed = ramped(self._speed, demand.speed, self._on)
        yaw_rate = self._yaw.step(demand.yaw_rate, measured, rolls=self._speed != 0.0)
        return self._speed, yaw_rate


class AckermannDrive:
    """Throttle against friction and drag.

    With the default gains (RO_SPEED_P and I nearly 0) it drives too fast, and does not move at 0.5
    m/s or below.
    """

    def __init__(self, on: Onboard) -> None:
        self._on = on
        self._asked = 0.0  # m/s, ramped
        self._integral = 0.0  # throttle
        self._speed = 0.0  # m/s, of the wheels
        self._underway = [0.0] * DEAD_TIME  # throttles within the dead time

    def step(self, demand: Demand) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period."""
        if demand.output is Output.OFF:
            self._asked = self._integral = 0.0
            self._underway = [0.0] * DEAD_TIME
            self._speed *= math.exp(-CONTROL_PERIOD / FREE_ROLLING)
            if abs(self._speed) < ROLLED_OUT:
                self._speed = 0.0
            return self._speed, 0.0
        self._underway.append(self._throttle(demand))
        self._speed = pushed(self._speed, self._underway.pop(0))
        yaw = demand.yaw_rate
        return self._speed, yaw if abs(self._speed) > ROLLED_OUT else 0.0

    def _throttle(self, demand: Demand) -> float:
        values, speed = self._on.parameters, self._on.estimate.forward_speed
        self._asked = ramped(self._asked, demand.speed, self._on)
        forward = self._asked / values["RO_MAX_THR_SPEED"]
        if abs(self._asked) < FLT_EPSILON:
            self._integral = 0.0
            return forward
        is_seen = abs(speed) > values["RO_SPEED_TH"]
        error = self._asked - (speed if is_seen else 0.0)
        self._integral += values["RO_SPEED_I"] * error * CONTROL_PERIOD
        self._integral = clipped(self._integral, 1.0)
        return clipped(forward + values["RO_SPEED_P"] * error + self._integral, 1.0)


def pushed(speed: float, throttle: float) -> float:
    """Return the speed one control period later, at this throttle."""
    thrust = THRUST * throttle
    if abs(speed) < ROLLED_OUT:
        if abs(thrust) <= BREAKAWAY:
            return 0.0
        return math.copysign((abs(thrust) - FRICTION) * CONTROL_PERIOD + ROLLED_OUT, thrust)
    resistance = math.copysign(FRICTION + DRAG * speed * speed, speed)
    after = speed + (thrust - resistance) * CONTROL_PERIOD
    return after if after * speed > 0.0 else 0.0


def ramped(speed: float, asked: float, on: Onboard) -> float:
    """Return the demanded speed one control period later, ramped within RO_*_LIM."""
    asked = clipped(asked, on.speed_limit)
    name = "RO_DECEL_LIM" if abs(asked) < abs(speed) else "RO_ACCEL_LIM"
    return toward(speed, asked, _limit(on.parameters[name]) * CONTROL_PERIOD)


def _limit(value: float) -> float:
    return value if value > 0.0 else MANY


def px4_drive(on: Onboard) -> DifferentialDrive | AckermannDrive:
    """Return the drive train of a frame."""
    return (AckermannDrive if on.persona.frame is Frame.ACKERMANN else DifferentialDrive)(on)
