"""Estimation errors that wander over seconds, as those of real estimators do.

The autopilot reports the estimate and steers by it, so an error of the estimated speed becomes an
error of the true speed.
"""

import math
from collections.abc import Iterator
from itertools import repeat
from random import Random

from rover_sim.body import BodyState, turned, wrap_angle
from rover_sim.motion import CONTROL_PERIOD, toward
from rover_sim.realism import EstimatorError, PushingError, Wander

PUSHES = 0.1  # m/s; a standing rover whose demand exceeds this pushes
STANDS = 0.02  # m/s
PUSHED_AFTER = 1.0  # s of pushing
UPSET_FOR = 100.0  # s; recorded of PX4's SIH: from the end of pushing until it reports standstill
NO_ERROR = (0.0, 0.0, 0.0)
GROWS_FOR = 3.0  # s from normal to upset, and back; recorded: the heading drifts by 7 deg in 5 s


def wandering(wander: Wander, chance: Random) -> Iterator[float]:
    """Yield an error for each control period: a Gauss-Markov process about a fixed value.

    It is of second order, two equal lags in series: recorded errors wander smoothly, with a
    correlation of 0.85 after 1 s and 0.35 after 3 s, which a single lag cannot give. What drives it
    is drawn evenly, which is fast; the lags make it a normal distribution.
    """
    random = chance.random
    fixed = chance.uniform(wander.least, wander.most)
    kept = math.exp(-CONTROL_PERIOD / wander.time)
    spread = wander.spread * math.sqrt(2.0)  # the second lag halves the variance
    fresh = spread * math.sqrt(12.0 * (1.0 - kept * kept))  # width of the even distribution
    driving = chance.gauss(0.0, spread)
    # steady state: half of the driving value, plus independently half of the variance
    error = 0.5 * driving + chance.gauss(0.0, wander.spread * math.sqrt(0.5))
    while True:
        driving = driving * kept + (random() - 0.5) * fresh
        error = driving + (error - driving) * kept
        yield fixed + error


def in_radians(error: Wander) -> Wander:
    """Return an error in radians that is given in degrees."""
    spread, least, most = map(math.radians, (error.spread, error.least, error.most))
    return Wander(spread, error.time, least, most)


class Estimator:
    """Sees the truth with errors. The same seed gives the same errors, step for step."""

    def __init__(self, error: EstimatorError, pushing: PushingError | None, *, seed: int) -> None:
        chance = Random(seed)
        self._forward = wandering(error.forward_speed, chance)
        self._right = wandering(error.lateral_speed, chance)
        self._north = wandering(error.position, chance)
        self._east = wandering(error.position, chance)
        self._yaw = wandering(in_radians(error.yaw), chance)
        self._yaw_rate = wandering(in_radians(error.yaw_rate), chance)
        drift = error.drift
        self._drift_north, self._drift_east = (
            repeat(0.0) if drift is None else wandering(drift, chance) for _ in range(2)
        )
        self._upset = None if pushing is None else Upset(pushing, chance)

    def see(self, truth: BodyState, *, asked: float) -> BodyState:
        """Advance by one control period; return the state that the rover believes.

        ``asked`` is the demanded speed, m/s. The velocity is measured in the ground's frame, so an
        error of the heading does not rotate it.
        """
        more_forward, more_right, more_yaw = (
            NO_ERROR if self._upset is None else self._upset.step(truth, asked=asked)
        )
        error = next(self._yaw) + more_yaw
        forward, lateral = turned(truth.forward_speed, truth.lateral_speed, -error)
        return truth._replace(
            north=truth.north + next(self._north) + next(self._drift_north),
            east=truth.east + next(self._east) + next(self._drift_east),
            yaw=wrap_angle(truth.yaw + error),
            forward_speed=forward + more_forward + next(self._forward),
            lateral_speed=lateral + more_right + next(self._right),
            yaw_rate=truth.yaw_rate + next(self._yaw_rate),
        )


class Upset:
    """The error of an estimator, for minutes after its rover pushed without moving."""

    def __init__(self, error: PushingError, chance: Random) -> None:
        self._forward = wandering(error.speed, chance)
        self._right = wandering(error.speed, chance)
        self._yaw = wandering(in_radians(error.yaw), chance)
        self._pushed = 0.0  # s of uninterrupted pushing
        self._left = 0.0  # s until it recovers
        self._share = 0.0  # 0 (normal) to 1 (fully upset)

    def step(self, truth: BodyState, *, asked: float) -> tuple[float, float, float]:
        """Advance by one control period; return the error forward, to the right, and of the yaw."""
        pushes = abs(asked) > PUSHES and abs(truth.forward_speed) < STANDS
        self._pushed = self._pushed + CONTROL_PERIOD if pushes else 0.0
        self._left = UPSET_FOR if self._pushed > PUSHED_AFTER else self._left - CONTROL_PERIOD
        goal = 1.0 if self._left > 0.0 else 0.0
        share = self._share = toward(self._share, goal, CONTROL_PERIOD / GROWS_FOR)
        if not share:
            return NO_ERROR
        return share * next(self._forward), share * next(self._right), share * next(self._yaw)
