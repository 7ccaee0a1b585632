"""A simulated rover in a world of its own, in which an observer's code runs in virtual time."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from mav_tasks.links.memory import MemoryNet
from rover_sim.observing.track import Place, Track
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.vehicle import Vehicle
from rover_sim.virtual import Party, RoverParty, VirtualWorld

T = TypeVar("T")

ROVER = "rover"
MOST_VIRTUAL, MOST_REAL = 7200.0, 300.0  # s, of one run


class VirtualGround:
    """The net, its world with the rover on the link ROVER, and the rover's true track."""

    def __init__(self, vehicle: Vehicle, net: MemoryNet | None = None) -> None:
        self.net = net or MemoryNet()
        self.vehicle = vehicle
        self.world = VirtualWorld(self.net)
        self.world.join(RoverParty(vehicle, self.net.link(ROVER)))
        self.world.watch(self._note)
        self.truth = Track()

    def run(self, coroutine: Coroutine[Any, Any, T], *parties: Party) -> T:
        """Run a coroutine to its end, beside more parties."""
        self.world.join(*parties)
        loop = VirtualLoop(self.world)
        loop.allow(MOST_VIRTUAL, real_seconds=MOST_REAL)
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            return runner.run(coroutine)

    def _note(self, _now: float) -> None:
        s = self.vehicle.truth
        place = Place(s.time, s.north, s.east, s.yaw, s.forward_speed, s.yaw_rate)
        self.truth.add(place)
