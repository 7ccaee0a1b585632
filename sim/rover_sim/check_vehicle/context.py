"""The arguments of every check."""

from dataclasses import dataclass

from rover_sim.check_vehicle.conventions import Conventions
from rover_sim.check_vehicle.probe import Heard, Probe
from rover_sim.check_vehicle.report import Report


@dataclass(frozen=True, slots=True)
class Options:
    """What a run may do to the vehicle. By default it changes and moves nothing for good."""

    arm: bool = False
    drive: bool = False
    write: bool = False  # missions and fences; the previous ones are restored
    persona: str = "auto"


@dataclass(frozen=True, slots=True)
class Context:
    """The link to a vehicle, what is expected of it, and the report."""

    probe: Probe
    way: Conventions
    report: Report
    options: Options
    first: Heard  # its first heartbeat
