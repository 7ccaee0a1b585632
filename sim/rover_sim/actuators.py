"""The single outputs and wheels of a rover, for faults that affect one of them."""

from collections.abc import Collection
from enum import Enum

from rover_sim.frames import Frame

HALF_TRACK = 0.23  # m, middle to wheel, as in the URDFs
DRAG = 0.5  # of its speed remains when one wheel drags and the other drives

PULL = 0.2  # 1/m, curvature of its path towards the blocked wheel


class Actuator(Enum):
    """An output that can freeze."""

    LEFT = "left"
    RIGHT = "right"
    THROTTLE = "throttle"
    STEERING = "steering"


SIDES = frozenset({Actuator.LEFT, Actuator.RIGHT})

Motion = tuple[float, float]  # m/s and rad/s clockwise, the arguments of ``Body.drive``


def sides_of(motion: Motion) -> tuple[float, float]:
    """Return the speeds of the left and the right wheels, m/s."""
    speed, rate = motion
    return speed + rate * HALF_TRACK, speed - rate * HALF_TRACK  # clockwise: left is faster


def with_frozen(motion: Motion, last: Motion, frozen: Collection[Actuator]) -> Motion:
    """Return the motion with the ``frozen`` outputs kept at their values in ``last``."""
    if not frozen:
        return motion
    if SIDES & set(frozen):
        left = sides_of(last if Actuator.LEFT in frozen else motion)[0]
        right = sides_of(last if Actuator.RIGHT in frozen else motion)[1]
        return (left + right) / 2.0, (left - right) / (2.0 * HALF_TRACK)
    speed = last[0] if Actuator.THROTTLE in frozen else motion[0]
    curvature_of = last if Actuator.STEERING in frozen else motion
    return speed, speed * curvature_of[1] / curvature_of[0] if curvature_of[0] else 0.0


def with_blocked(motion: Motion, blocked: Collection[Actuator], frame: Frame) -> Motion:
    """Return the motion of a rover whose wheels are blocked on one side or on both."""
    if set(blocked) >= SIDES:
        return 0.0, 0.0
    if not blocked:
        return motion
    if frame is Frame.ACKERMANN:
        speed = motion[0] * DRAG
        pull = -PULL if Actuator.LEFT in blocked else PULL
        return speed, motion[1] * DRAG + pull * speed
    return with_frozen(motion, (0.0, 0.0), blocked)


def wheels_of(side: str) -> frozenset[Actuator]:
    """Return the sides that ``side`` names: left, right or all. Raise ValueError otherwise."""
    sides = {"left": {Actuator.LEFT}, "right": {Actuator.RIGHT}, "all": SIDES}
    if side not in sides:
        raise ValueError(f"wheels are left, right or all, not {side!r}")
    return frozenset(sides[side])


def output_of(name: str, frame: Frame) -> Actuator:
    """Return the output with that name. Raise ValueError if this frame lacks it."""
    outputs = [each for each in Actuator if (each in SIDES) is frame.turns_on_the_spot]
    if name in (known := [each.value for each in outputs]):
        return Actuator(name)
    words = " and ".join(known)
    raise ValueError(f"the outputs of this frame ({frame.value}) are {words}, not {name!r}")
