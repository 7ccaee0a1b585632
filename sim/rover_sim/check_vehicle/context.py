"""What every check is given."""

from dataclasses import dataclass

from rover_sim.check_vehicle.conventions import Conventions
from rover_sim.check_vehicle.probe import Heard, Probe
from rover_sim.check_vehicle.report import Report


@dataclass(frozen=True, slots=True)
class Options:
    """What a run may do to the vehicle. By default nothing that lasts or moves it."""

    arm: bool = False
    drive: bool = False
    write: bool = False  # missions and fences; what was there is put back
    persona: str = "auto"


@dataclass(frozen=True, slots=True)
class Context:
    """A conversation with a vehicle, what is expected of it, and where the lines go."""

    probe: Probe
    way: Conventions
    report: Report
    options: Options
    first: Heard  # its first heartbeat
