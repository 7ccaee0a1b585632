"""The bodies of rovers, by their physics and frame."""

from rover_sim.ackermann import AckermannBody
from rover_sim.body import Body, Pose
from rover_sim.bullet import BulletBody
from rover_sim.frames import Frame
from rover_sim.kinematic import KinematicBody

SLIP = 0.3  # of the turns of a skid-steered rover, as bullet's


def kinematic_body(frame: Frame, *, start: Pose, slip: float, seed: int | None) -> Body:
    """Return a body; steered wheels do not slip as skid-steered ones do."""
    if frame is Frame.ACKERMANN:
        return AckermannBody(start=start, seed=seed)
    return KinematicBody(start=start, slip=slip, seed=seed)


def make_body(
    kind: str,
    frame: Frame,
    *,
    start: Pose,
    seed: int | None,
    friction: float = 0.8,
    variation: float = 0.0,
    gui: bool = False,
) -> Body:
    """Return a body, with real physics if its kind is "bullet". Raise MissingExtra.

    ``friction``, its ``variation`` and ``gui`` are bullet's; without it, a rover slips as one of
    bullet does by default.
    """
    if kind == "kinematic":
        return kinematic_body(frame, start=start, slip=SLIP, seed=seed)
    return BulletBody(
        start=start, frame=frame, friction=friction, variation=variation, seed=seed, gui=gui
    )
