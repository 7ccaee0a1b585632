"""The body without a physics engine for each frame."""

from rover_sim.ackermann import AckermannBody
from rover_sim.body import Body, Pose
from rover_sim.frames import Frame
from rover_sim.kinematic import KinematicBody


def kinematic_body(frame: Frame, *, start: Pose, slip: float, seed: int | None) -> Body:
    """Return a body; steered wheels do not slip as skid-steered ones do."""
    if frame is Frame.ACKERMANN:
        return AckermannBody(start=start, seed=seed)
    return KinematicBody(start=start, slip=slip, seed=seed)
