"""By how much the estimate is off: errors that wander over seconds, as real estimators' do.

The autopilot reports what it sees and steers by it, so that an error of its speed becomes an error
of its true speed. Where there is no error, there is no estimator: what is seen is the truth.
"""

import math
from dataclasses import replace
from random import Random

from rover_sim.body import BodyState, wrap_angle
from rover_sim.motion import CONTROL_PERIOD
from rover_sim.realism import EstimatorError, Wander

PUSHES = 0.1  # m/s; asked for more than this while it stands, it pushes
STANDS = 0.02  # m/s
PUSHED_AFTER = 1.0  # s of pushing
UPSET_FOR = 120.0  # s; recorded of PX4: "for minutes"


class WanderingValue:
    """One axis of an error: a first-order Gauss-Markov process about a fixed value."""

    def __init__(self, wander: Wander, chance: Random) -> None:
        self._chance = chance
        self._fixed = chance.uniform(wander.least, wander.most)
        self._kept = math.exp(-CONTROL_PERIOD / wander.time)
        self._fresh = wander.spread * math.sqrt(1.0 - self._kept * self._kept)
        self._wandering = chance.gauss(0.0, wander.spread)

    def __repr__(self) -> str:
        return f"WanderingValue({self.value:.4g})"

    @property
    def value(self) -> float:
        """The error of this moment."""
        return self._fixed + self._wandering

    def step(self) -> float:
        """Live through one control period; return the error then."""
        self._wandering = self._wandering * self._kept + self._chance.gauss(0.0, self._fresh)
        return self._fixed + self._wandering


class Estimator:
    """Sees the truth with errors. The same seed makes the same errors, step for step."""

    def __init__(self, error: EstimatorError, *, seed: int) -> None:
        chance = Random(seed)
        self._forward = WanderingValue(error.forward_speed, chance)
        self._right = WanderingValue(error.lateral_speed, chance)
        self._north = WanderingValue(error.position, chance)
        self._east = WanderingValue(error.position, chance)
        self._yaw = WanderingValue(error.yaw, chance)
        self._yaw_rate = WanderingValue(error.yaw_rate, chance)
        self._upset = None if error.pushing is None else Upset(error.pushing, chance)

    def __repr__(self) -> str:
        return f"Estimator({self._forward!r}, {self._right!r})"

    def see(self, truth: BodyState, *, asked: float) -> BodyState:
        """Return what the rover takes for the truth, one control period later than before.

        ``asked`` is the speed for which the wheels push, m/s. The velocity is measured in the
        ground's frame: an error of the heading does not turn it.
        """
        error = self._yaw.step()
        cos, sin = math.cos(error), math.sin(error)
        forward = truth.forward_speed * cos + truth.lateral_speed * sin
        lateral = truth.lateral_speed * cos - truth.forward_speed * sin
        if self._upset is not None:
            more_forward, more_right = self._upset.step(truth, asked=asked)
            forward, lateral = forward + more_forward, lateral + more_right
        return BodyState(  # not replace(): this is called forty times a second
            time=truth.time,
            north=truth.north + self._north.step(),
            east=truth.east + self._east.step(),
            down=truth.down,
            yaw=wrap_angle(truth.yaw + error),
            pitch=truth.pitch,
            roll=truth.roll,
            forward_speed=forward + self._forward.step(),
            lateral_speed=lateral + self._right.step(),
            yaw_rate=truth.yaw_rate + self._yaw_rate.step(),
        )


class Upset:
    """The error of an estimator that has felt its rover push without moving, for minutes."""

    def __init__(self, wander: Wander, chance: Random) -> None:
        self._forward = WanderingValue(wander, chance)
        self._right = WanderingValue(replace(wander, least=0.0, most=0.0), chance)
        self._pushed = 0.0  # s without a break
        self._left = 0.0  # s until it has recovered

    def __repr__(self) -> str:
        return f"Upset({self._left:.1f} s)"

    def step(self, truth: BodyState, *, asked: float) -> tuple[float, float]:
        """Live through one control period; return the error forward and to the right, m/s."""
        pushes = abs(asked) > PUSHES and abs(truth.forward_speed) < STANDS
        self._pushed = self._pushed + CONTROL_PERIOD if pushes else 0.0
        self._left = UPSET_FOR if self._pushed > PUSHED_AFTER else self._left - CONTROL_PERIOD
        forward, right = self._forward.step(), self._right.step()
        return (forward, right) if self._left > 0.0 else (0.0, 0.0)
