"""The world of one test: rovers, a task server and clients in virtual time.

Virtual time stands still while the test's own code runs. It advances inside ``run``, ``sleep`` and
``until``, and while a client waits.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine
from datetime import UTC, datetime
from itertools import count
from typing import Any, TypeVar

from mav_tasks.client.aio import Client
from mav_tasks.client.sync import SyncClient
from mav_tasks.config.settings import Settings
from mav_tasks.links.memory import MemoryLink
from mav_tasks.shell.in_memory import CLIENT_LINK
from rover_sim.body import Body, Pose
from rover_sim.errors import NotInVirtualTime, Stalled
from rover_sim.kinematic_bodies import make_body
from rover_sim.testing.lossy import LossyLink, LossyNet
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.simulated_rover import SimulatedRover
from rover_sim.testing.task_server import TaskServer
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

T = TypeVar("T")

SPACING = 3.0  # m between rovers, side by side
VARIATION = 0.3  # of the friction of bullet's ground
LOOK = 0.02  # s of virtual time between two checks of a condition
CLEAN_UP = 10.0  # virtual s for cancelled tasks to end


class RoverWorld:
    """All parties of one test. The same seed gives the same run, bit for bit."""

    def __init__(self, options: RoverOptions, *, seed: int, settings: Settings) -> None:
        self.options = options
        self.seed = seed
        self._began = round(time.time())  # whole seconds, as start times by the time of day are
        self._net = LossyNet(seed=seed)
        self._world = VirtualWorld(self._net)
        self._numbers = count(1)
        self._bodies: list[Body] = []
        self.rovers = tuple(self._add_rover(number) for number in range(1, options.count + 1))
        names = tuple(f"rover{rover.system_id}" for rover in self.rovers)
        self.server = TaskServer(
            self._world, vehicles=names, settings=settings, wall_offset=self._began
        )
        self.lossy_link = LossyLink(self._net)
        self._loop = VirtualLoop(self._world)
        self._runner = asyncio.Runner(loop_factory=lambda: self._loop)
        self._runner.get_loop()

    def __repr__(self) -> str:
        return f"RoverWorld(at {self.now:.3f} s, seed {self.seed}, {len(self.rovers)} rovers)"

    @property
    def now(self) -> float:
        """Virtual seconds since the start of the world."""
        return self._world.now

    @property
    def utc(self) -> datetime:
        """Time of day in this world; it starts at the real time, rounded to a second."""
        return datetime.fromtimestamp(self._began + self.now, UTC)

    def run(self, coroutine: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine to its end in virtual time. Raise Stalled or NotInVirtualTime.

        Tasks that it leaves behind continue in the next call.
        """
        __tracebackhide__ = True
        if _is_in_a_loop():
            coroutine.close()
            raise NotInVirtualTime(
                "an event loop is running here already: inside of a coroutine await"
                " rover_world.client(), and give the coroutine to rover_world.run()"
            )
        self._allow(self.options.limit)
        task = self._loop.create_task(coroutine)
        try:
            return self._loop.run_until_complete(task)
        except Stalled as stalled:
            raise stalled.with_traceback(None) from None  # its message says who waits
        finally:
            if not task.done():
                self._cut_off(task)

    call = run  # SyncClient's name for it

    def sleep(self, seconds: float) -> None:
        """Let virtual time pass. Raise Stalled beyond the marker's ``limit``."""
        __tracebackhide__ = True
        self.run(asyncio.sleep(seconds))

    def until(self, condition: Callable[[], object], *, within: float = 60.0) -> None:
        """Let virtual time pass until the condition holds. Raise AssertionError if it does not."""
        __tracebackhide__ = True
        end = self.now + within
        while not condition():  # outside the loop, so that the condition can use a SyncClient
            assert self.now < end, f"not within {within:g} s of virtual time"
            self.sleep(LOOK)

    def link(self) -> MemoryLink:
        """Return a new link for one client to the server."""
        return self._net.link(f"client{next(self._numbers)}", peers=(CLIENT_LINK,))

    def client(self) -> Client:
        """Return another client for ``async with``, for use in a coroutine that ``run`` runs."""
        return Client(self.link())

    def sync_client(self) -> SyncClient:
        """Return another client for ``with``; each call advances time until its answer comes."""
        return SyncClient(self.link(), portal=self)

    def close(self) -> None:
        """Cancel running tasks and release all resources."""
        self._allow(CLEAN_UP)
        try:
            self._runner.close()
        finally:
            for body in self._bodies:
                body.close()

    def _allow(self, seconds: float) -> None:
        self._loop.allow(seconds, real_seconds=self.options.real_limit)

    def _cut_off(self, task: asyncio.Task[Any]) -> None:
        """Cancel the task of a stalled run, so that it does not continue in the next."""
        self._allow(CLEAN_UP * 2)
        task.cancel()
        self._loop.run_until_complete(asyncio.wait({task}, timeout=CLEAN_UP))

    def _add_rover(self, number: int) -> SimulatedRover:
        persona, seed = self.options.make, self.seed + number
        start = Pose(east=SPACING * (number - 1))
        kind = self.options.body
        body = make_body(kind, persona.frame, start=start, seed=seed, variation=VARIATION)
        self._bodies.append(body)
        vehicle = make_vehicle(body, system_id=number, now=0.0, persona=persona, seed=seed)
        if "COM_OBL_RC_ACT" in vehicle.autopilot.parameters:
            # Hold: by default a PX4 rover drives home when setpoints stop, and the server drives no
            # task
            vehicle.autopilot.parameters["COM_OBL_RC_ACT"] = 5
        self._world.join(RoverParty(vehicle, self._net.link(f"rover{number}")))
        return SimulatedRover(vehicle, persona=persona, clock=lambda: self.now)


def _is_in_a_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
