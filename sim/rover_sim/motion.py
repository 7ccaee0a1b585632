"""The speed and turn-rate controllers: demands into wheel speeds, within what a rover can do."""

from rover_sim.body import BodyState
from rover_sim.estimate import Estimate
from rover_sim.realism import Drive
from rover_sim.steering import MAX_YAW_RATE, Demand

CONTROL_RATE = 40  # Hz. Divides 240 Hz physics; 20 and 10 Hz telemetry comes evenly spaced
CONTROL_PERIOD = 1.0 / CONTROL_RATE  # s
ACCELERATION = 1.0  # m/s²; 2 m/s in about 2 s, as observed
YAW_ACCELERATION = 2.1  # rad/s², ArduPilot's ATC_STR_ACC_MAX of 120 deg/s²
YAW_P = 0.8
YAW_I = 8.0  # 1/s; friction differs with heading, a slow loop would show it
YAW_I_LIMIT = 2.0  # rad/s; a skid-steered rover loses a third of its yaw rate to scrubbing


class MotionControl:
    """Ramps a demand and closes the loop on the yaw rate, which wheels alone do not give.

    Speed needs no loop: wheels that push straight ahead hardly slip.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._speed = 0.0
        self._yaw_rate = 0.0
        self._correction = 0.0

    def __repr__(self) -> str:
        return f"MotionControl({self._speed:.2f} m/s, {self._yaw_rate:.2f} rad/s)"

    def step(self, demand: Demand, truth: BodyState, estimate: Estimate) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period.

        A real drive closes its loops on the estimate, an exact one on the truth.
        """
        yaw_rate = truth.yaw_rate if self._drive is Drive.EXACT else estimate.yaw_rate
        speed = self._speed = _ramped_speed(self._speed, demand)
        wanted = max(-MAX_YAW_RATE, min(MAX_YAW_RATE, demand.yaw_rate))
        rate = self._yaw_rate = _toward(self._yaw_rate, wanted, YAW_ACCELERATION * CONTROL_PERIOD)
        if rate == 0.0 and (speed == 0.0 or abs(yaw_rate) < 1e-6):
            self._correction = 0.0
            return speed, 0.0  # locked wheels are the exact stop
        error = rate - yaw_rate
        integral = self._correction + YAW_I * error * CONTROL_PERIOD
        self._correction = max(-YAW_I_LIMIT, min(YAW_I_LIMIT, integral))
        return speed, rate + YAW_P * error + self._correction


def _ramped_speed(speed: float, demand: Demand) -> float:
    """Brake at the demand's rate, speed up at the rover's; a change of direction is both."""
    wanted = demand.speed
    if speed * wanted < 0.0 or abs(wanted) < abs(speed):
        goal = 0.0 if speed * wanted < 0.0 else wanted
        return _toward(speed, goal, demand.braking * CONTROL_PERIOD)
    return _toward(speed, wanted, ACCELERATION * CONTROL_PERIOD)


def _toward(value: float, goal: float, step: float) -> float:
    change = goal - value
    if abs(change) <= step:
        return goal
    return value + step if change > 0 else value - step
