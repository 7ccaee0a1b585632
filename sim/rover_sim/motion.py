"""The speed and yaw rate controllers: demands to wheel speeds, within a rover's limits.

``MotionControl`` is the exact one, for tests with exact arithmetic: it follows a ramp, and stops
where it should.
"""

from dataclasses import dataclass

from rover_sim.body import BodyState
from rover_sim.estimate import Estimate
from rover_sim.steering import MAX_YAW_RATE, Demand

CONTROL_RATE = 40  # Hz. Divides the 240 Hz physics; 20 and 10 Hz telemetry is evenly spaced
CONTROL_PERIOD = 1.0 / CONTROL_RATE  # s
ACCELERATION = 1.0  # m/s²; 2 m/s in about 2 s, as observed
YAW_P = 0.8
YAW_I = 8.0  # 1/s; friction differs with heading, and a slow loop would show that
YAW_I_LIMIT = 2.0  # rad/s; a skid-steered rover loses a third of its yaw rate to scrubbing


@dataclass(frozen=True, slots=True)
class YawLimits:
    """Limits of a yaw rate loop."""

    rate: float  # rad/s
    acceleration: float  # rad/s²
    deceleration: float  # rad/s²
    integral: float = YAW_I  # 1/s


EXACT_LIMITS = YawLimits(MAX_YAW_RATE, 2.1, 2.1)  # ArduPilot's ATC_STR_ACC_MAX of 120 deg/s²


class YawControl:
    """Ramps a yaw rate and closes the loop on it, because scrubbing wheels lose part of it."""

    def __init__(self, limits: YawLimits = EXACT_LIMITS) -> None:
        self._limits = limits
        self.yaw_rate = 0.0  # rad/s, the ramped demand
        self._correction = 0.0

    def __repr__(self) -> str:
        return f"YawControl({self.yaw_rate:.2f} rad/s)"

    def step(self, demanded: float, measured: float, *, rolls: bool) -> float:
        """Return the yaw rate for the wheels, for one control period."""
        limits = self._limits
        wanted = max(-limits.rate, min(limits.rate, demanded))
        slows = abs(wanted) < abs(self.yaw_rate)
        change = limits.deceleration if slows else limits.acceleration
        rate = self.yaw_rate = toward(self.yaw_rate, wanted, change * CONTROL_PERIOD)
        if rate == 0.0 and (not rolls or abs(measured) < 1e-6):
            self._correction = 0.0
            return 0.0  # locked wheels stop exactly
        error = rate - measured
        integral = self._correction + limits.integral * error * CONTROL_PERIOD
        self._correction = max(-YAW_I_LIMIT, min(YAW_I_LIMIT, integral))
        return rate + YAW_P * error + self._correction


class MotionControl:
    """Ramps a demand and closes the loop on the true yaw rate; implements ``DriveTrain``.

    Speed needs no loop: wheels hardly slip when they drive straight ahead.
    """

    def __init__(self) -> None:
        self._speed = 0.0
        self._yaw = YawControl()

    def __repr__(self) -> str:
        return f"MotionControl({self._speed:.2f} m/s, {self._yaw!r})"

    def step(self, demand: Demand, truth: BodyState, estimate: Estimate) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period."""
        del estimate
        speed = self._speed = _ramped_speed(self._speed, demand)
        return speed, self._yaw.step(demand.yaw_rate, truth.yaw_rate, rolls=speed != 0.0)


def toward(value: float, goal: float, step: float) -> float:
    """Return the value, moved towards the goal by at most ``step``."""
    change = goal - value
    if abs(change) <= step:
        return goal
    return value + step if change > 0 else value - step


def _ramped_speed(speed: float, demand: Demand) -> float:
    """Brake at the demand's rate, accelerate at the rover's; stop before changing direction."""
    wanted = demand.speed
    if speed * wanted < 0.0 or abs(wanted) < abs(speed):
        goal = 0.0 if speed * wanted < 0.0 else wanted
        return toward(speed, goal, demand.braking * CONTROL_PERIOD)
    return toward(speed, wanted, ACCELERATION * CONTROL_PERIOD)
