"""Motors and servos of the pybullet rovers: a demanded motion becomes a target for each joint.

Only ``bullet`` imports pybullet; this file gets the module as an argument.
"""

import math
from collections.abc import Mapping
from typing import Any, Protocol

from rover_sim.ackermann import steering_for
from rover_sim.frames import SERVO_RATE, WHEEL_BASE

WHEEL_RADIUS = 0.1  # m, as in the URDFs; the next one, too
HALF_TRACK = 0.23  # m, middle to wheel
MAX_TORQUE = 20.0  # N·m per wheel; a turn on the spot takes 9 at friction 1.1, and stalls with 6
SERVO_TORQUE = 20.0  # N·m; the wheels turn on their contact points
SIDES = ("front_left", "front_right", "rear_left", "rear_right")


class Wheels(Protocol):
    """The joints that a body's ``drive`` sets."""

    @property
    def joints(self) -> tuple[int, ...]:
        """The four axles: front left, front right, rear left, rear right."""
        ...

    def drive(self, forward_speed: float, yaw_rate: float, *, steps: int) -> None:
        """Set every motor for this motion; one call of the engine does ``steps`` physics steps."""
        ...


class SkidWheels:
    """Four driven wheels, both of a side at the same speed; implements ``Wheels``."""

    def __init__(self, p: Any, client: int, rover: int) -> None:
        self._p, self._client, self._rover = p, client, rover
        joints = joints_of(p, client, rover)
        self.joints = tuple(joints[f"{side}_axle"] for side in SIDES)

    def __repr__(self) -> str:
        return f"SkidWheels({self.joints})"

    def drive(self, forward_speed: float, yaw_rate: float, *, steps: int) -> None:
        """Set the four motors."""
        left = (forward_speed + yaw_rate * HALF_TRACK) / WHEEL_RADIUS  # clockwise: left is faster
        right = (forward_speed - yaw_rate * HALF_TRACK) / WHEEL_RADIUS
        # Bullet computes an impulse limit from the torque limit and the length of the whole step,
        # and applies it in every sub-step: without the division the motors are ``steps`` times as
        # strong.
        self._p.setJointMotorControlArray(
            self._rover,
            self.joints,
            self._p.VELOCITY_CONTROL,
            targetVelocities=(left, right, left, right),
            forces=(MAX_TORQUE / steps,) * 4,
            physicsClientId=self._client,
        )


class SteeredWheels:
    """Two rear wheels driven through a differential, two steered; implements ``Wheels``."""

    def __init__(self, p: Any, client: int, rover: int) -> None:
        self._p, self._client, self._rover = p, client, rover
        joints = joints_of(p, client, rover)
        self.joints = tuple(joints[f"{side}_axle"] for side in SIDES)
        self._knuckles = (joints["front_left_steering"], joints["front_right_steering"])
        self._steering = 0.0  # rad, of a virtual wheel in the middle, right is positive

    def __repr__(self) -> str:
        return f"SteeredWheels({math.degrees(self._steering):.0f} deg)"

    def drive(self, forward_speed: float, yaw_rate: float, *, steps: int) -> None:
        """Set servos and motors; the front wheels roll freely."""
        self._steering = steering_for(forward_speed, yaw_rate, self._steering)
        turned = forward_speed * math.tan(self._steering) / WHEEL_BASE
        self._steer(steps)
        left = (forward_speed + turned * HALF_TRACK) / WHEEL_RADIUS
        right = (forward_speed - turned * HALF_TRACK) / WHEEL_RADIUS
        self._p.setJointMotorControlArray(
            self._rover,
            self.joints,
            self._p.VELOCITY_CONTROL,
            targetVelocities=(0.0, 0.0, left, right),
            forces=(0.0, 0.0, MAX_TORQUE / steps, MAX_TORQUE / steps),
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


def joints_of(p: Any, client: int, rover: int) -> Mapping[str, int]:
    """Return the joints of a rover by name."""
    count = p.getNumJoints(rover, physicsClientId=client)
    infos = (p.getJointInfo(rover, joint, physicsClientId=client) for joint in range(count))
    return {info[1].decode(): info[0] for info in infos}
