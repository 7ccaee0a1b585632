"""ArduPilot Rover's speed and steering controllers, driving the vehicles of its SITL.

A PI loop on the *estimated* speed sets a throttle in steps of 1 us, and the vehicle follows the
throttle slowly. This causes overshoot, oscillation and rolling on, and it turns an error of the
estimate into an error of the true speed. Fitted to recordings of Rover 4.6.3 (steps of 0.5, 1 and 2
m/s, HOLD and disarming at 1 m/s, 0.5 m/s with 20 deg/s).
"""

import math
from dataclasses import dataclass

from rover_sim.frames import TURN_RADIUS, Frame
from rover_sim.motion import CONTROL_PERIOD, YawControl, clipped, toward
from rover_sim.onboard import Onboard
from rover_sim.steering import MAX_YAW_RATE, Demand, Output

ACCELERATION = 1.0  # m/s², ATC_ACCEL_MAX; for braking, too
STOPPED = 0.1  # m/s, ATC_STOP_SPEED: below this, a demand of zero cuts the throttle
SLEW = 1.0  # of full throttle per second, MOT_SLEWRATE; it also limits how fast HOLD cuts
PWM_STEPS = 500  # us from neutral to full
ERROR_FILTER = 0.016  # s, ATC_SPEED_FLTE: 10 Hz
YAW_LIMITS = MAX_YAW_RATE, 2.1, 3.5  # rad/s, and rad/s² up and down, ATC_STR_ACC_MAX
ROLLED_OUT = 1e-3  # m/s; a slower vehicle stands
FEED_FORWARD = 0.78  # of the lock per rad/s demanded
STEERING_P = 0.25  # of the lock per rad/s of error


def _part(time: float) -> float:
    """Return the fraction of an error that a first-order lag removes in one control period."""
    return 1.0 - math.exp(-CONTROL_PERIOD / time)


FILTER_SHARE = _part(ERROR_FILTER)


@dataclass(frozen=True, slots=True)
class SpeedGains:
    """The gains of the speed loop and the vehicle's response to the throttle."""

    base: float  # throttle (0..1) per m/s demanded: CRUISE_THROTTLE by CRUISE_SPEED
    p: float  # throttle per m/s of error: ATC_SPEED_P
    i: float  # throttle per m/s of error and second: ATC_SPEED_I
    top: float  # m/s at full throttle
    lag: float  # s, time constant of the vehicle's speed, also while it rolls freely


# The parameters of SITL's frames; speed and acceleration of their vehicles at full throttle.
# "rover": 30 % for 5 m/s; 20 m/s and 10 m/s², so it rolls on with a time constant of 2 s
ACKERMANN_GAINS = SpeedGains(base=0.06, p=0.1, i=0.2, top=20.0, lag=2.0)
# "rover-skid": 75 % for 3 m/s; 4 m/s and 14 m/s², so 0.286 s
SKID_GAINS = SpeedGains(base=0.25, p=0.2, i=0.2, top=4.0, lag=0.286)


class ArduPilotDrive:
    """ArduPilot Rover's controllers: speed, and a yaw rate loop.

    On skid steer, wheels without throttle still resist a turn. With steered wheels the loop sets
    their angle. With the default gains it is too small: 20 deg/s at 0.5 m/s gives 10 deg/s.
    """

    def __init__(self, on: Onboard) -> None:
        self._on = on
        self._is_steered = on.persona.frame is Frame.ACKERMANN
        self._gains = ACKERMANN_GAINS if self._is_steered else SKID_GAINS
        self._yaw = YawControl(*YAW_LIMITS)
        self._share = _part(self._gains.lag)
        self._asked = 0.0  # m/s, the demand after the acceleration limit
        self._error = 0.0  # m/s, filtered
        self._integral = 0.0  # throttle
        self._throttle = 0.0  # of the motors: -1..1, slewed
        self._speed = 0.0  # m/s, of the wheels

    def step(self, demand: Demand) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period."""
        estimate, is_controlled = self._on.estimate, demand.output is Output.CONTROLLED
        if is_controlled:
            wanted = self._controlled(demand.speed, estimate.forward_speed)
        else:
            self._asked, self._error, self._integral = estimate.forward_speed, 0.0, 0.0
            wanted = 0.0
        if demand.output is Output.OFF:
            self._throttle = 0.0
        else:
            self._throttle = toward(self._throttle, wanted, SLEW * CONTROL_PERIOD)
        pulse = round(self._throttle * PWM_STEPS) / PWM_STEPS  # in whole us
        self._speed += (self._gains.top * pulse - self._speed) * self._share
        if pulse == 0.0 and abs(self._speed) < ROLLED_OUT:
            self._speed = 0.0
        asked = demand.yaw_rate if is_controlled else 0.0
        if not self._is_steered:
            return self._speed, self._yaw.step(asked, estimate.yaw_rate, rolls=self._speed != 0.0)
        lock = FEED_FORWARD * asked + STEERING_P * (asked - estimate.yaw_rate) if asked else 0.0
        # reversed while the estimate says that the rover rolls backwards, as it should be
        lock = clipped(lock if estimate.forward_speed >= 0.0 else -lock, 1.0)
        return self._speed, self._speed * lock / TURN_RADIUS

    def _controlled(self, asked: float, speed: float) -> float:
        """Return the throttle that the speed loop demands, -1..1."""
        self._asked = toward(self._asked, asked, ACCELERATION * CONTROL_PERIOD)
        if self._asked == asked == 0.0 and abs(speed) <= STOPPED:
            self._error = self._integral = 0.0
            return 0.0
        gains = self._gains
        self._error += (self._asked - speed - self._error) * FILTER_SHARE
        self._integral += gains.i * self._error * CONTROL_PERIOD
        wanted = gains.base * self._asked + gains.p * self._error + self._integral
        limited = clipped(wanted, 1.0)
        self._integral -= wanted - limited
        return limited
