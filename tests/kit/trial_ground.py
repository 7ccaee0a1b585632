"""A realistic simulated rover as the ground of a field trial, in virtual time."""

import asyncio
from collections.abc import Coroutine
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, TypeVar

from mav_tasks.client.aio import Client
from mav_tasks.config.settings import Settings
from mav_tasks.links.memory import MemoryNet
from mav_tasks.shell.in_memory import CLIENT_LINK, VEHICLE_LINK
from rover_sim.body import Pose
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.observing.virtual import ROVER, VirtualGround
from rover_sim.personas import PERSONAS
from rover_sim.realism import Gps
from rover_sim.testing.task_server import TaskServer
from rover_sim.trial.session import Ground
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import VirtualWorld

T = TypeVar("T")

SEED = 1
SLIP = 0.3  # of the kinematic body, as in the pytest plugin
NEUTRAL = 1500  # µs
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


class VirtualServer:
    """Implements the trial's ``Server``."""

    def __init__(self, world: VirtualWorld) -> None:
        self._server = TaskServer(world, vehicles=(ROVER,), settings=Settings(), wall_offset=0.0)

    async def start(self) -> None:
        self._server.start()

    async def end(self) -> None:
        if self._server.is_running:
            self._server.stop()
        async with asyncio.timeout(SIGTERM_WITHIN):
            while self._server.is_running:  # noqa: ASYNC110  # it has no event of its own
                await asyncio.sleep(LOOK)

    async def kill(self) -> None:
        self._server.kill()

    def why_ended(self) -> str:
        return ""


class TrialGround(Ground):
    """A rover whose restart and stick are at hand; ``run`` runs a trial in its time."""

    can_reboot = True

    def __init__(self, make: Make, *, seed: int = SEED) -> None:
        persona = PERSONAS[make.persona].on(make.frame)
        realism = replace(persona.realism, estimator=persona.estimators[make.gps])
        numbers = count()
        body = kinematic_body(make.frame, start=Pose(), slip=SLIP, seed=seed)
        vehicle = self.vehicle = make_vehicle(
            body, system_id=1, now=0.0, persona=persona, realism=realism, seed=seed
        )
        for name, value in make.parameters:
            vehicle.autopilot.parameters[name] = value

        self._virtual = VirtualGround(vehicle, MemoryNet(seed=seed))
        net = self._virtual.net
        super().__init__(
            VirtualServer(self._virtual.world),
            lambda: Client(net.link(f"client{next(numbers)}", peers=(CLIENT_LINK,))),
            lambda: net.link(VEHICLE_LINK, peers=(ROVER,)),
            self._virtual.truth,
        )

    def run(self, trial: Coroutine[Any, Any, T]) -> T:
        """Run a trial to its end, in virtual time."""
        return self._virtual.run(trial)

    async def reboot(self) -> None:
        self.vehicle.autopilot.reboot(now=self._virtual.world.now)

    can_push_stick = True

    def push_stick(self, throttle: int | None) -> None:
        pulse = NEUTRAL if throttle is None else throttle
        self.vehicle.autopilot.operator_pulses(pulse, NEUTRAL)
