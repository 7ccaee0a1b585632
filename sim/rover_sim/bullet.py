"""The rover in pybullet: wheels, motors, mass and friction. The only file that imports pybullet.

Each body has its own physics client (world), so that rovers do not slow each other down and each
can be closed separately. No Python runs per physics step: the motors are set once per control step,
and one ``stepSimulation`` call does its physics steps inside the engine.

The wheels collide as spheres. Measured on this rover, closed loop at 20 Hz, at friction 0.5, 0.8
and 1.1: with spheres and with cylinders, 2 m forward ends within 0.3 cm along the path, and 90
degrees on the spot within 0.2 degrees. But cylinders deviate by up to 0.7 cm across the path and
3.3 cm from the spot, spheres by 0.0 and 0.2 cm: a cylinder's contact jumps between its rims.
Spheres are also 1.5 times as fast.
"""

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from random import Random
from typing import Any

from rover_sim.body import BodyState, Pose, turned, wrap_angle
from rover_sim.bullet_wheels import Wheels
from rover_sim.errors import MissingExtra
from rover_sim.frames import Frame
from rover_sim.motion import clipped

REMEDY = "pip install pybullet numpy; its wheels are for Python 3.11 at most, on Linux x86-64"
#: the text for a kinematic body that replaces the pybullet one
NO_PYBULLET = (
    "pybullet is not installed, so the rover is the kinematic one: no wheels, no friction"
    f" ({REMEDY})"
)
PHYSICS_RATE = 240  # Hz, pybullet's own default; stepping and sub-stepping alike
GRAVITY = 9.81  # m/s²
SOLVER_ITERATIONS = 20  # turns within 8 % of those with 150 iterations; 1.5 times as fast as 50
ASSETS = Path(__file__).parent / "assets"
RIDE_HEIGHT = 0.15  # m, ground to the base's origin, as in the URDFs
SETTLING = 0.5  # s, from the drop onto the wheels to rest
WHEEL_SPREAD = 0.05  # of the friction; how far one wheel may deviate from the ground's value
WHEELS = 4


class BulletBody:
    """A wheeled body in its own world; implements ``Body``.

    ``friction`` is tyre against ground. ``variation`` (0.3 for ±30 %) with ``seed`` draws the
    ground's friction around it, and a smaller deviation for each wheel, as of worn tyres.

    Raise MissingExtra if pybullet is not installed.
    """

    lag = 0.0  # s; its motors have enough torque to follow at once

    def __init__(
        self,
        *,
        start: Pose,
        frame: Frame = Frame.SKID,
        friction: float = 0.8,
        variation: float = 0.0,
        seed: int | None = None,
        gui: bool = False,
    ) -> None:
        self._p = _pybullet()
        self._client: int = self._p.connect(self._p.GUI if gui else self._p.DIRECT)
        self._steps = 1  # physics steps to one stepSimulation
        self._demand = (0.0, 0.0)
        self._time = 0.0
        skids = frame.turns_on_the_spot
        urdf = ASSETS / ("rover.urdf" if skids else "ackermann.urdf")
        self._rover = self._build(start, urdf)
        self._wheels = Wheels(self._p, self._client, self._rover, steered=not skids)
        for axle, own in zip(
            self._wheels.axles, _wheel_frictions(friction, variation, seed), strict=True
        ):
            self._p.changeDynamics(
                self._rover, axle, lateralFriction=own, physicsClientId=self._client
            )
        self.advance(SETTLING)
        self._time = 0.0

    @property
    def state(self) -> BodyState:
        """The state after the last ``advance``."""
        p, client, rover = self._p, self._client, self._rover
        (x, y, z), (qx, qy, qz, qw) = p.getBasePositionAndOrientation(rover, client)
        (vx, vy, _), (_, _, wz) = p.getBaseVelocity(rover, client)
        # pybullet is x north, y west, z up; body axes forward, left, up.
        heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        forward, left = turned(vx, vy, -heading)
        return BodyState(
            time=self._time,
            north=x,
            east=-y,
            down=RIDE_HEIGHT - z,
            yaw=-heading,
            pitch=-math.asin(clipped(2.0 * (qw * qy - qz * qx), 1.0)),
            roll=math.atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy)),
            forward_speed=forward,
            lateral_speed=-left,
            yaw_rate=-wz,
        )

    def drive(self, forward_speed: float, yaw_rate: float) -> None:
        """Demand a motion, kept until the next call."""
        if (forward_speed, yaw_rate) != self._demand:  # velocity motors keep their target
            self._demand = (forward_speed, yaw_rate)
            self._wheels.drive(*self._demand, steps=self._steps)

    def advance(self, duration: float) -> None:
        """Step the physics by a multiple of 1/240 s; fastest if it is the same each time."""
        steps = round(duration * PHYSICS_RATE)
        if steps != self._steps:
            self._p.setPhysicsEngineParameter(
                fixedTimeStep=steps / PHYSICS_RATE,
                numSubSteps=steps,
                physicsClientId=self._client,
            )
            self._steps = steps
            self._wheels.drive(*self._demand, steps=self._steps)
        self._p.stepSimulation(self._client)
        self._time += duration

    def close(self) -> None:
        """Disconnect from the physics engine; a second call does nothing."""
        if self._client >= 0:
            self._p.disconnect(self._client)
            self._client = -1

    def _build(self, start: Pose, urdf: Path) -> int:
        p, client = self._p, self._client
        p.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        # Bullet resolves friction along the world's axes, so a steady demand gives a yaw rate that
        # depends on the heading: 0.59 to 0.89 of the demanded rate; theory says 0.57. With the
        # default, the implicit friction cone, it is 0.12 to 0.53.
        p.setPhysicsEngineParameter(
            enableConeFriction=0, numSolverIterations=SOLVER_ITERATIONS, physicsClientId=client
        )
        plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=client)
        ground = p.createMultiBody(0, plane, physicsClientId=client)
        p.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
        rover: int = p.loadURDF(
            str(urdf),
            basePosition=(start.north, -start.east, RIDE_HEIGHT),
            baseOrientation=p.getQuaternionFromEuler((0.0, 0.0, -wrap_angle(start.yaw))),
            flags=p.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=client,
        )
        # Set damping only on the base: set for a wheel, pybullet 3.2.7 drops the wheel's friction.
        p.changeDynamics(rover, -1, linearDamping=0, angularDamping=0, physicsClientId=client)
        return rover


def _wheel_frictions(friction: float, variation: float, seed: int | None) -> list[float]:
    if variation == 0.0:
        return [friction] * WHEELS
    draw = Random(seed)
    ground = friction * draw.uniform(1.0 - variation, 1.0 + variation)
    return [ground * draw.uniform(1.0 - WHEEL_SPREAD, 1.0 + WHEEL_SPREAD) for _ in range(WHEELS)]


def has_pybullet() -> bool:
    """Return whether pybullet is installed."""
    return find_spec("pybullet") is not None


def _pybullet() -> Any:
    """Import pybullet late, so that the rest of the simulator works without it."""
    try:
        with _silent_stderr():
            import pybullet  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtra(
            f"the pybullet rover needs pybullet, or use the kinematic one: {REMEDY}"
        ) from error
    return pybullet


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """Keep pybullet's greeting ("pybullet build time: ..."), which C code writes, off stderr."""
    saved = os.dup(2)
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(sink)
        os.close(saved)
