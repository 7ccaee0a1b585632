"""Estimation errors that wander over seconds, as those of real estimators do.

The autopilot reports the estimate and steers by it, so an error of the estimated speed becomes an
error of the true speed. An exact rover has no estimator: it sees the truth.
"""

import math
from random import Random
from typing import NamedTuple

from rover_sim.body import BodyState, wrap_angle
from rover_sim.motion import CONTROL_PERIOD, toward
from rover_sim.realism import EstimatorError, PushingError, Wander

PUSHES = 0.1  # m/s; a standing rover whose demand exceeds this pushes
STANDS = 0.02  # m/s
PUSHED_AFTER = 1.0  # s of pushing
UPSET_FOR = 100.0  # s; recorded of PX4's SIH: from the end of pushing until it reports standstill
GROWS_FOR = 3.0  # s from normal to upset, and back; recorded: the heading drifts by 7 deg in 5 s


class WanderingValue:
    """One axis of an error: a Gauss-Markov process about a fixed value.

    It is of second order, two equal lags in series: recorded errors wander smoothly, with a
    correlation of 0.85 after 1 s and 0.35 after 3 s, which a single lag cannot give.
    """

    def __init__(self, wander: Wander, chance: Random) -> None:
        self._chance = chance
        self._fixed = chance.uniform(wander.least, wander.most)
        self._kept = math.exp(-CONTROL_PERIOD / wander.time)
        driving = wander.spread * math.sqrt(2.0)  # the second lag halves the variance
        self._fresh = driving * math.sqrt(1.0 - self._kept * self._kept)
        self._driving = chance.gauss(0.0, driving)
        # steady state: half of the driving value, plus independently half of the variance
        self._wandering = 0.5 * self._driving + chance.gauss(0.0, wander.spread * math.sqrt(0.5))

    def __repr__(self) -> str:
        return f"WanderingValue({self.value:.4g})"

    @property
    def value(self) -> float:
        """The present error."""
        return self._fixed + self._wandering

    def step(self) -> float:
        """Advance by one control period; return the new error."""
        self._driving = self._driving * self._kept + self._chance.gauss(0.0, self._fresh)
        self._wandering = self._driving + (self._wandering - self._driving) * self._kept
        return self._fixed + self._wandering


class Estimator:
    """Sees the truth with errors. The same seed gives the same errors, step for step."""

    def __init__(self, error: EstimatorError, *, seed: int) -> None:
        chance = Random(seed)
        self._forward = WanderingValue(error.forward_speed, chance)
        self._right = WanderingValue(error.lateral_speed, chance)
        self._north = WanderingValue(error.position, chance)
        self._east = WanderingValue(error.position, chance)
        self._yaw = WanderingValue(error.yaw, chance)
        self._yaw_rate = WanderingValue(error.yaw_rate, chance)
        self._drift = None if error.drift is None else Drift(error.drift, chance)
        self._upset = None if error.pushing is None else Upset(error.pushing, chance)

    def __repr__(self) -> str:
        return f"Estimator({self._forward!r}, {self._right!r})"

    def see(self, truth: BodyState, *, asked: float) -> BodyState:
        """Advance by one control period; return the state that the rover believes.

        ``asked`` is the demanded speed, m/s. The velocity is measured in the ground's frame, so an
        error of the heading does not rotate it.
        """
        upset = RIGHT if self._upset is None else self._upset.step(truth, asked=asked)
        error = self._yaw.step() + upset.yaw
        away_north, away_east = NOWHERE if self._drift is None else self._drift.step()
        cos, sin = math.cos(error), math.sin(error)
        forward = truth.forward_speed * cos + truth.lateral_speed * sin + upset.forward
        lateral = truth.lateral_speed * cos - truth.forward_speed * sin + upset.right
        return BodyState(  # not replace(): this is called forty times a second
            time=truth.time,
            north=truth.north + self._north.step() + away_north,
            east=truth.east + self._east.step() + away_east,
            down=truth.down,
            yaw=wrap_angle(truth.yaw + error),
            pitch=truth.pitch,
            roll=truth.roll,
            forward_speed=forward + self._forward.step(),
            lateral_speed=lateral + self._right.step(),
            yaw_rate=truth.yaw_rate + self._yaw_rate.step(),
        )


NOWHERE = (0.0, 0.0)


class Drift:
    """Slow drift of a position over minutes, north and east."""

    def __init__(self, wander: Wander, chance: Random) -> None:
        self._north = WanderingValue(wander, chance)
        self._east = WanderingValue(wander, chance)

    def __repr__(self) -> str:
        return f"Drift({self._north.value:.2f} N, {self._east.value:.2f} E)"

    def step(self) -> tuple[float, float]:
        """Advance by one control period; return the drift north and east, m."""
        return self._north.step(), self._east.step()


class MoreError(NamedTuple):
    """The additional error of an upset estimate."""

    forward: float  # m/s
    right: float  # m/s
    yaw: float  # rad


RIGHT = MoreError(0.0, 0.0, 0.0)


class Upset:
    """The error of an estimator, for minutes after its rover pushed without moving."""

    def __init__(self, error: PushingError, chance: Random) -> None:
        self._forward = WanderingValue(error.speed, chance)
        self._right = WanderingValue(error.speed, chance)
        self._yaw = WanderingValue(error.yaw, chance)
        self._pushed = 0.0  # s of uninterrupted pushing
        self._left = 0.0  # s until it recovers
        self._share = 0.0  # 0 (normal) to 1 (fully upset)

    def __repr__(self) -> str:
        return f"Upset({self._left:.1f} s)"

    def step(self, truth: BodyState, *, asked: float) -> MoreError:
        """Advance by one control period; return the additional error."""
        pushes = abs(asked) > PUSHES and abs(truth.forward_speed) < STANDS
        self._pushed = self._pushed + CONTROL_PERIOD if pushes else 0.0
        self._left = UPSET_FOR if self._pushed > PUSHED_AFTER else self._left - CONTROL_PERIOD
        goal = 1.0 if self._left > 0.0 else 0.0
        share = self._share = toward(self._share, goal, CONTROL_PERIOD / GROWS_FOR)
        return MoreError(
            share * self._forward.step(), share * self._right.step(), share * self._yaw.step()
        )
