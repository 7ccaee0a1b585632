"""The four compared rovers: an autopilot and a frame each."""

import math
from dataclasses import dataclass, replace

from rover_sim.body import Pose
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import PERSONAS
from rover_sim.realism import Gps
from rover_sim.vehicle import Vehicle, make_vehicle

SYSTEM_ID = 1


@dataclass(frozen=True, slots=True)
class Pair:
    """An autopilot with a frame, and its real counterpart."""

    autopilot: str
    frame: Frame
    real: str  # autopilot, version, vehicle: the source of the reference figures
    heading: float = 0.0  # rad, the real one's heading at the start
    gps: Gps = Gps.FINE  # class of the real one's errors

    @property
    def name(self) -> str:
        """Its name on the command line and in the tables."""
        return f"{self.autopilot}-{self.frame.value}"


ARDUPILOT_SKID = Pair("ardupilot", Frame.SKID, "ArduPilot Rover 4.6.3 SITL, rover-skid")
ARDUPILOT_ACKERMANN = Pair("ardupilot", Frame.ACKERMANN, "ArduPilot Rover 4.6.3 SITL, rover")
PX4_DIFFERENTIAL = Pair(
    "px4",
    Frame.DIFFERENTIAL,
    "PX4 1.17.0 SITL in lock-step with a kinematic differential rover",
    heading=math.pi / 2,
)
PX4_ACKERMANN = Pair(
    "px4",
    Frame.ACKERMANN,
    "PX4 1.17.0, the Ackermann rover of its SIH",
    gps=Gps.METRE,
)

#: in the order of the columns of the reference tables
PAIRS = (ARDUPILOT_SKID, ARDUPILOT_ACKERMANN, PX4_DIFFERENTIAL, PX4_ACKERMANN)


def make_rover(pair: Pair, *, seed: int) -> Vehicle:
    """Return the simulated rover, just powered on, with a boot of real duration.

    Its wheels neither slip nor vary between rovers, as in the recordings.
    """
    persona = PERSONAS[pair.autopilot].on(pair.frame)
    realism = replace(persona.realism, boot=persona.boot, estimator=persona.estimators[pair.gps])
    body = kinematic_body(pair.frame, start=Pose(yaw=pair.heading), slip=0.0, seed=None)
    return make_vehicle(
        body, system_id=SYSTEM_ID, now=0.0, persona=persona, realism=realism, seed=seed
    )
