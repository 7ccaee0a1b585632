"""Guidance: where the vehicle is on its leg → the velocity to command. Stateless.

The loop is closed on the measured pose. Nothing is integrated, so that a lost setpoint, a pause or
a pre-emption leaves no error behind. ``limits`` bounds the velocity before it is sent.
"""

from dataclasses import dataclass
from math import copysign, hypot, inf, pi, sqrt, tan
from typing import NamedTuple

from mav_tasks.config.settings import Driving
from mav_tasks.kinds.path import wrap
from mav_tasks.kinds.places import Pose

APPROACH_GAIN = 1.2  # 1/s, in the last centimetres: speed = gain * remaining
#: m/s, the least setpoint; half of it moved no ArduPilot reliably (its PWM is then 1500)
CREEP_SPEED = 0.05
TURN_GAIN = 1.6  # 1/s, the same for turning
CREEP_RATE = 0.03  # rad/s
HEADING_GAIN = 1.5  # 1/s, heading error -> turn rate while moving
MAX_APPROACH_ANGLE = pi / 6  # rad, towards the line
MAX_STEER_RATE = 0.5  # rad/s, of corrections while moving
PIVOT_ERROR = pi / 4  # rad; with a larger heading error it turns on the spot before it drives
#: m/s, limit at such an error for a car, and for a vehicle that is steered by course: it may turn
#: on the spot by itself, or in an arc
BOW_SPEED = 0.2
#: factor on a car's known curvature that may be commanded: with default gains ArduPilot's steering
#: reaches half of it (4.6.3, SITL)
MORE_CURVATURE = 2.0
#: m/s², lateral acceleration in bends. ArduPilot's own limit is 0.6 g (ATC_TURN_MAX_G), at which
#: its simulated car (4.6.3) is far outside a bend before its wheels have turned
ACROSS = 0.5


@dataclass(frozen=True, slots=True)
class Motion:
    """A vehicle's measured pose and velocity, and when (monotonic seconds).

    ``forward`` and ``sideways`` in m/s along and across the body, ``yaw_rate`` in rad/s. ``at`` is
    the older of the times of position and attitude.
    """

    pose: Pose
    forward: float
    sideways: float
    yaw_rate: float
    at: float

    @property
    def speed(self) -> float:
        """Speed over ground, m/s."""
        return hypot(self.forward, self.sideways)


@dataclass(frozen=True, slots=True)
class Velocity:
    """A setpoint in the body frame: m/s forward, rad/s clockwise.

    ``course`` is the direction to drive in, rad from north, for a vehicle that is steered by
    course; the yaw rate is 0 then, and ``forward`` not negative.
    """

    forward: float
    yaw_rate: float
    course: float | None = None

    @property
    def is_zero(self) -> bool:
        """Whether this asks for standstill; a course alone asks for a turn to it."""
        return self.forward == 0.0 and self.yaw_rate == 0.0 and self.course is None


ZERO = Velocity(0.0, 0.0)


class Slowest(NamedTuple):
    """One rover's values for the end of a leg, as ``arrival`` has learnt them."""

    speed: float = CREEP_SPEED  # m/s, the least that moves it
    rate: float = CREEP_RATE  # rad/s, the same for turning
    gain: float = APPROACH_GAIN  # 1/s, speed per metre left
    turn_gain: float = TURN_GAIN  # 1/s, the same for turning


USUAL = Slowest()


def clamped(value: float, most: float) -> float:
    """Return the value that is nearest to this one and within ±``most``."""
    return max(-most, min(most, value))


class Situation(NamedTuple):
    """Where a vehicle is on a leg, and how it is driven."""

    anchor: Pose  # where the leg began
    motion: Motion
    along: float  # m, rad or s of the leg that are done
    remaining: float  # its rest; negative beyond the end, from where the vehicle drives back slowly
    driving: Driving
    passing: float = 0.0  # m/s, speed at the end if it goes on there
    by_course: bool = False  # it is steered by course, and does not reverse
    radius: float | None = None  # m, minimum turning radius of a car
    settles: bool = True  # it shall be exact at the end, and not only on the way
    slowest: Slowest = USUAL


def towards(error: float, forward: float, now: Situation) -> Velocity:
    """Return the velocity that drives on with a heading error, in rad, to be corrected.

    It drives if its heading is about right, and turns otherwise. A car, or a vehicle that is
    steered by course, drives slowly meanwhile instead of turning on the spot.
    """
    if now.by_course:
        slow = min(forward, BOW_SPEED) if is_far_off(error) else forward
        return Velocity(max(slow, 0.0), 0.0, wrap(now.motion.pose.yaw + error))
    turn = clamped(HEADING_GAIN * error, MAX_STEER_RATE)
    if now.radius is None:
        return Velocity(0.0 if is_far_off(error) else forward, turn)
    slow = min(abs(forward), BOW_SPEED) if is_far_off(error) else abs(forward)
    return Velocity(copysign(slow, forward), clamped(turn, MORE_CURVATURE * slow / now.radius))


def is_far_off(heading_error: float) -> bool:
    """Return whether a vehicle has to turn before it can drive on."""
    return abs(heading_error) > PIVOT_ERROR


def corner_speed(turn: float, *, lead: float) -> float:
    """Return the speed in m/s for a corner of ``turn`` rad that is cut ``lead`` m before.

    Return 0 if the vehicle has to stop and turn on the spot.
    """
    bend = abs(turn)
    if bend > PIVOT_ERROR:
        return 0.0
    return MAX_STEER_RATE * lead / max(tan(bend / 2), 1e-3)


def approach(
    remaining: float,
    *,
    top: float,
    braking: float,
    gain: float,
    creep: float,
    at_end: float = 0.0,
) -> float:
    """Return the speed at a distance: the highest that allows braking, then ``gain`` * distance."""
    left = abs(remaining)
    braked = sqrt(at_end * at_end + 2 * 0.5 * braking * left)
    return max(min(creep, top), min(top, max(gain * left, at_end), braked))


def bend_speed(curvature: float, driving: Driving) -> float:
    """Return the highest speed in m/s for a circle of this curvature."""
    bend = abs(curvature)
    if bend == 0.0:
        return inf
    return min(driving.turn_rate / bend, sqrt(ACROSS / bend))
