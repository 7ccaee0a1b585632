"""A skid-steered body without a physics engine: lag, acceleration limits, slip.

For fast tests, and for Python versions that have no pybullet wheel.
"""

from rover_sim.body import Pose
from rover_sim.planar import PlanarBody, approach

LAG = 0.08  # s, first-order lag from wheel-speed demand to motion
MAX_YAW_ACCELERATION = 12.0  # rad/s²
SLIP_SPREAD = 0.3  # of the slip; a seed changes it by up to this, either way


class KinematicBody(PlanarBody):
    """Moves as demanded, with a small lag; implements ``Body``.

    ``slip`` is the fraction of a demanded yaw rate that scrubbing tyres lose (0 none, 0.3 as the
    pybullet rover). ``seed`` varies slip and lag between rovers; None varies neither.
    """

    def __init__(self, *, start: Pose, slip: float, seed: int | None) -> None:
        if not 0.0 <= slip < 1.0:
            raise ValueError(f"slip must be in [0, 1), not {slip}")
        super().__init__(start=start, lag=LAG, seed=seed)
        self._grip = 1.0 - min(slip * (1.0 + self._varied(SLIP_SPREAD)), 0.95)
        self._demanded_yaw_rate = 0.0

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion, kept until the next call."""
        self._demanded_speed = forward_speed
        self._demanded_yaw_rate = yaw_rate * self._grip

    def _next_yaw_rate(self, speed: float, dt: float) -> float:
        del speed
        wanted = self._demanded_yaw_rate
        return approach(self.state.yaw_rate, wanted, self.lag, MAX_YAW_ACCELERATION, dt)
