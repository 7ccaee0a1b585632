"""The demonstration in virtual time: one process, the same server, rover and third party."""

import asyncio

from mav_tasks.config.settings import Recording, Settings
from mav_tasks.links.memory import MemoryNet
from mav_tasks.recording import observers
from mav_tasks.shell.in_memory import CLIENT_LINK, InMemoryServer
from rover_sim.body import Pose
from rover_sim.bullet import BulletBody
from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import PATIENCE, ThirdParty
from rover_sim.kinematic import KinematicBody
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Place, Track
from rover_sim.testing.virtual_loop import VirtualLoop
from rover_sim.vehicle import make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

MOST_REAL = 300.0  # s
REFRESH = 0.2  # s
SLIP = 0.3


def drive(screen: Screen, *, body: str, seed: int, record: str) -> tuple[ThirdParty, Track]:
    """Run server, rover and third party; return the third party and the true track.

    ``record`` is the folder for a record of the server's decisions, "" for none.
    """
    settings, track = Settings(), Track()
    recorders = observers(Recording(decisions=record), settings, None, now=0.0)
    net = MemoryNet()
    is_kinematic = body == "kinematic"
    kinematic = KinematicBody(start=Pose(), slip=SLIP, seed=seed or None) if is_kinematic else None
    physics = kinematic or BulletBody(start=Pose(), variation=SLIP if seed else 0.0, seed=seed)
    vehicle = make_vehicle(physics, system_id=1, now=0.0, seed=seed)
    world = VirtualWorld(net)
    server = InMemoryServer(net, vehicles=("rover",), settings=settings, observers=recorders)
    world.join(RoverParty(vehicle, net.link("rover")), server)

    def follow(now: float) -> None:
        state = vehicle.truth
        track.add(Place(now, state.north, state.east, state.yaw))

    world.watch(follow)
    loop = VirtualLoop(world)
    loop.allow(2 * PATIENCE, real_seconds=MOST_REAL)
    link = net.link("third party", peers=(CLIENT_LINK,))

    async def run() -> ThirdParty:
        party = ThirdParty(
            Observer(link),
            lambda: track.last,
            lambda text: screen.say(f"{world.now:6.1f} s  {text}"),
        )
        running = asyncio.ensure_future(party.run())
        while not running.done():
            await asyncio.sleep(REFRESH)
            screen.update(party)
        await running
        return party

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        party = runner.run(run())
    vehicle.body.close()
    for recorder in recorders:
        recorder.close()
    return party, track
