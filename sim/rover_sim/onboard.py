"""What the parts of one autopilot share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rover_sim.outbox import Outbox

if TYPE_CHECKING:
    from rover_sim.boot import Boot
    from rover_sim.estimate import Estimate
    from rover_sim.flight import Flight
    from rover_sim.geo import Origin
    from rover_sim.mission_storage import MissionStorage
    from rover_sim.parameters import Parameters
    from rover_sim.personas import Persona
    from rover_sim.realism import Realism
    from rover_sim.sticks import Sticks
    from rover_sim.streams import Streams

FASTEST = 5.0  # m/s, about the motors' limit, if the parameter sets none


@dataclass(slots=True)
class Onboard:
    """The state of one autopilot. ``now`` is the time of the present call, in seconds."""

    persona: Persona
    realism: Realism
    origin: Origin
    uid: int  # distinguishes simulated rovers
    estimate: Estimate
    now: float
    outbox: Outbox = field(default_factory=Outbox)
    # set by the autopilot; they survive a restart
    parameters: Parameters = field(init=False)
    missions: MissionStorage = field(init=False)
    sticks: Sticks = field(init=False)
    # new with each start
    started: float = field(init=False)
    boot: Boot = field(init=False)
    flight: Flight = field(init=False)
    streams: Streams = field(init=False)

    @property
    def speed_limit(self) -> float:
        """The speed limit in m/s; a parameter of 0 or less means "no limit" (PX4)."""
        limit = self.parameters[self.persona.speed_parameter]
        return limit if limit > 0.0 else FASTEST
