"""Motors and servos of the pybullet rovers: a demanded motion becomes a target for each joint.

Only ``bullet`` imports pybullet; this file gets the module as an argument.
"""

import math
from typing import Any

from rover_sim.ackermann import steering_for
from rover_sim.actuators import HALF_TRACK, sides_of
from rover_sim.frames import SERVO_RATE, WHEEL_BASE

WHEEL_RADIUS = 0.1  # m, as in the URDFs
MAX_TORQUE = 20.0  # N·m per wheel; a turn on the spot takes 9 at friction 1.1, and stalls with 6
SERVO_TORQUE = 20.0  # N·m; the wheels turn on their contact points
SIDES = ("front_left", "front_right", "rear_left", "rear_right")


class Wheels:
    """Four driven wheels, both of a side at the same speed; or two rear ones, and two steered."""

    def __init__(self, p: Any, client: int, rover: int, *, steered: bool) -> None:
        self._p, self._client, self._rover = p, client, rover
        infos = (
            p.getJointInfo(rover, joint, client) for joint in range(p.getNumJoints(rover, client))
        )
        joints: dict[str, int] = {info[1].decode(): info[0] for info in infos}
        self.axles = [joints[f"{side}_axle"] for side in SIDES]
        self._knuckles = [joints[f"{side}_steering"] for side in SIDES[:2]] if steered else []
        self._steering = 0.0  # rad, of a virtual wheel in the middle, right is positive

    def drive(self, forward_speed: float, yaw_rate: float, *, steps: int) -> None:
        """Set every motor for this motion; one call of the engine does ``steps`` physics steps.

        Bullet computes an impulse limit from the torque limit and the length of the whole step, and
        applies it in every sub-step: without a division the motors are ``steps`` times as strong.
        """
        if self._knuckles:
            self._steering = steering_for(forward_speed, yaw_rate, self._steering)
            yaw_rate = forward_speed * math.tan(self._steering) / WHEEL_BASE
            self._steer(steps)
        sides = [each / WHEEL_RADIUS for each in sides_of((forward_speed, yaw_rate))]
        torques = [MAX_TORQUE / steps] * 2
        free = [0.0, 0.0] if self._knuckles else None  # the front wheels of a steered rover
        self._p.setJointMotorControlArray(
            self._rover,
            self.axles,
            self._p.VELOCITY_CONTROL,
            targetVelocities=(free or sides) + sides,
            forces=(free or torques) + torques,
            physicsClientId=self._client,
        )

    def _steer(self, steps: int) -> None:
        """Turn each front wheel to the tangent of its own circle; all circles share one centre."""
        curvature = math.tan(self._steering) / WHEEL_BASE  # 1/m
        for joint, side in zip(self._knuckles, (HALF_TRACK, -HALF_TRACK), strict=True):
            angle = math.atan(WHEEL_BASE * curvature / (1.0 + side * curvature))
            self._p.setJointMotorControl2(
                self._rover,
                joint,
                self._p.POSITION_CONTROL,
                targetPosition=-angle,  # pybullet's z is up: left is positive
                force=SERVO_TORQUE / steps,
                maxVelocity=SERVO_RATE,
                physicsClientId=self._client,
            )
