"""A pytest plugin with a simulated rover. This module imports the public names on first use.

pytest loads the plugin in every run where it is installed, so this package must not import anything
by itself.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rover_sim.errors import NotInVirtualTime as NotInVirtualTime
    from rover_sim.errors import Stalled as Stalled
    from rover_sim.faults import Faults as Faults
    from rover_sim.testing.lossy import LossyLink as LossyLink
    from rover_sim.testing.rover_world import RoverWorld as RoverWorld
    from rover_sim.testing.simulated_rover import SimulatedRover as SimulatedRover
    from rover_sim.testing.task_server import TaskServer as TaskServer

_WHERE = {
    "Faults": "rover_sim.faults",
    "LossyLink": "rover_sim.testing.lossy",
    "NotInVirtualTime": "rover_sim.errors",
    "RoverWorld": "rover_sim.testing.rover_world",
    "SimulatedRover": "rover_sim.testing.simulated_rover",
    "Stalled": "rover_sim.errors",
    "TaskServer": "rover_sim.testing.task_server",
}

__all__ = tuple(_WHERE)


def __getattr__(name: str) -> object:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_WHERE[name]), name)
