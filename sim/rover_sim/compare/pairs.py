"""The four rovers that are compared: an autopilot and a frame each."""

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
    """An autopilot with a frame, and the real one whose figures it is held against."""

    autopilot: str
    frame: Frame
    real: str  # autopilot, version, vehicle: the source of the reference figures
    heading: float = 0.0  # rad, where the real one looked at the start
    gps: Gps = Gps.FINE  # what the real one's errors are like

    @property
    def name(self) -> str:
        """What it is called on the command line and in the tables."""
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
    """Return that simulated rover, just switched on, whose boot takes as long as a real one's.

    Its wheels neither slip nor differ from rover to rover: those of the recordings did not.
    """
    persona = PERSONAS[pair.autopilot].on(pair.frame)
    realism = replace(persona.realism, boot=persona.boot, estimator=persona.estimators[pair.gps])
    body = kinematic_body(pair.frame, start=Pose(yaw=pair.heading), slip=0.0, seed=None)
    return make_vehicle(
        body, system_id=SYSTEM_ID, now=0.0, persona=persona, realism=realism, seed=seed
    )
