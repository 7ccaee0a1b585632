"""From demand to wheels: the drive train protocol, and the drive train of each make."""

from typing import Protocol

from rover_sim.ardupilot_drive import (
    ACKERMANN_GAINS,
    SKID_GAINS,
    ArduPilotDrive,
    SkidSteering,
    WheelSteering,
)
from rover_sim.body import BodyState
from rover_sim.estimate import Estimate
from rover_sim.frames import Frame
from rover_sim.parameters import Parameters
from rover_sim.px4_drive import AckermannDrive, DifferentialDrive
from rover_sim.steering import Demand


class DriveTrain(Protocol):
    """Speed and yaw rate controllers with the motors that they drive."""

    def step(self, demand: Demand, truth: BodyState, estimate: Estimate) -> tuple[float, float]:
        """Return forward speed and yaw rate for the wheels, for one control period."""
        ...


def ardupilot_drive(frame: Frame, _parameters: Parameters) -> DriveTrain:
    """Return ArduPilot Rover's drive train, on SITL's vehicle."""
    if frame is Frame.ACKERMANN:
        return ArduPilotDrive(ACKERMANN_GAINS, WheelSteering())
    return ArduPilotDrive(SKID_GAINS, SkidSteering())


def px4_drive(frame: Frame, parameters: Parameters) -> DriveTrain:
    """Return PX4's drive train."""
    if frame is Frame.ACKERMANN:
        return AckermannDrive(parameters)
    return DifferentialDrive(parameters)
