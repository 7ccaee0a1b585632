"""A realistic simulated rover as the ground of a field trial, in virtual time."""

import asyncio
from collections.abc import Coroutine
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from mav_tasks.client.aio import Client
from mav_tasks.config.settings import Settings
from mav_tasks.links.base import Link
from mav_tasks.links.memory import MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from rover_sim.body import Pose
from rover_sim.field_trial.track import Place, Track
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.personas import PERSONAS
from rover_sim.realism import Gps
from rover_sim.testing.task_server import TaskServer
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

T = TypeVar("T")

SEED = 1
ROVER = "rover1"
SLIP = 0.3  # of the kinematic body, as in the pytest plugin
NEUTRAL = 1500  # µs
MOST_VIRTUAL, MOST_REAL = 7200.0, 300.0  # s, of one trial
SIGTERM_WITHIN = 5.0  # s
LOOK = 0.05  # s


@dataclass(frozen=True, slots=True)
class Make:
    """A rover, with its owner's parameters."""

    persona: str
    frame: Frame
    gps: Gps = Gps.FINE
    parameters: tuple[tuple[str, float], ...] = ()


STANDS_AT_LOSS = ("COM_OBL_RC_ACT", 5.0)  # what mav-tasks probe --set-failsafe sets
FOLLOWS = (("RO_SPEED_P", 0.4), ("RO_SPEED_I", 0.5))  # with less, it does not move at 0.5 m/s
MAKES = {
    "ardupilot skid": Make("ardupilot", Frame.SKID),
    "ardupilot ackermann": Make("ardupilot", Frame.ACKERMANN),
    "px4 differential": Make("px4", Frame.DIFFERENTIAL, parameters=(STANDS_AT_LOSS,)),
    "px4 ackermann": Make("px4", Frame.ACKERMANN, Gps.METRE, (STANDS_AT_LOSS, *FOLLOWS)),
}


class TrialGround:
    """Implements ``Ground``; ``run`` runs a trial in its time."""

    def __init__(self, make: Make, *, seed: int = SEED) -> None:
        persona = PERSONAS[make.persona].on(make.frame)
        realism = replace(persona.realism, estimator=persona.estimators[make.gps])
        net = MemoryNet(seed=seed)
        self._net = net
        self._world = VirtualWorld(net)
        body = kinematic_body(make.frame, start=Pose(), slip=SLIP, seed=seed)
        self.vehicle = make_vehicle(
            body, system_id=1, now=0.0, persona=persona, realism=realism, seed=seed
        )
        for name, value in make.parameters:
            self.vehicle.autopilot.parameters[name] = value
        self._world.join(RoverParty(self.vehicle, net.link(ROVER)))
        self._server = TaskServer(
            self._world, vehicles=(ROVER,), settings=Settings(), wall_offset=0.0
        )
        self.truth: Track | None = Track()
        self._world.watch(self._note)
        self._loop = VirtualLoop(self._world)
        self._clients = 0

    def run(self, trial: Coroutine[Any, Any, T]) -> T:
        """Run a trial to its end, in virtual time."""
        self._loop.allow(MOST_VIRTUAL, real_seconds=MOST_REAL)
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            return runner.run(trial)

    async def start_server(self) -> None:
        """Start the server on the store of the previous one."""
        self._server.start()

    async def end_server(self) -> None:
        """End the server in order."""
        if self._server.is_running:
            self._server.stop()
        for _ in range(round(SIGTERM_WITHIN / LOOK)):
            if not self._server.is_running:
                return
            await asyncio.sleep(LOOK)
        raise TimeoutError(f"the server still runs {SIGTERM_WITHIN} s after it was asked to end")

    async def kill_server(self) -> None:
        """Kill the server."""
        self._server.kill()

    def client(self) -> Client:
        """Return another client."""
        self._clients += 1
        return Client(self._net.link(f"client{self._clients}", peers=(CLIENT_LINK,)))

    def rover_link(self) -> Link:
        """Return a link at the server's address, to which the rover speaks."""
        return self._net.link(VEHICLE_LINK, peers=(ROVER,))

    can_reboot = True

    async def reboot(self) -> None:
        """Restart the autopilot."""
        self.vehicle.autopilot.reboot(now=self._world.now)

    can_push_stick = True

    def push_stick(self, throttle: int | None) -> None:
        """Hold the transmitter's throttle stick; None is neutral."""
        pulse = NEUTRAL if throttle is None else throttle
        self.vehicle.autopilot.operator_pulses(pulse, NEUTRAL)

    def _note(self, now: float) -> None:
        state = self.vehicle.truth
        assert self.truth is not None
        if not len(self.truth) or now >= self.truth.last.time + LOOK / 2:
            self.truth.add(Place(now, state.north, state.east, state.yaw))
