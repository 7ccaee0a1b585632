"""The demonstration in virtual time: one process, the same server, rover and third party."""

import typer

from mav_tasks.config.settings import Recording, Settings
from mav_tasks.recording import observers
from mav_tasks.shell.in_memory import CLIENT_LINK, InMemoryServer
from rover_sim.body import Pose
from rover_sim.demo.third_party import ThirdParty
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import make_body
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from rover_sim.observing.virtual import ROVER, VirtualGround
from rover_sim.vehicle import make_vehicle

VARIATION = 0.3  # of the friction


def drive(*, body: str, seed: int, record: str) -> tuple[ThirdParty, Track]:
    """Run server, rover and third party; return the third party and the true track.

    ``record`` is the folder for a record of the server's decisions, "" for none.
    """
    settings = Settings()
    recorders = observers(Recording(decisions=record), settings, None, now=0.0)
    variation = VARIATION if seed else 0.0
    physics = make_body(body, Frame.SKID, start=Pose(), seed=seed or None, variation=variation)
    ground = VirtualGround(make_vehicle(physics, system_id=1, now=0.0, seed=seed))
    net, track = ground.net, ground.truth
    server = InMemoryServer(net, vehicles=(ROVER,), settings=settings, observers=recorders)

    def say(text: str) -> None:
        typer.echo(f"{ground.world.now:6.1f} s  {text}")

    async def run() -> ThirdParty:
        observer = Observer(net.link("third party", peers=(CLIENT_LINK,)))
        return await ThirdParty(observer, lambda: track.last, say).run()

    party = ground.run(run(), server)
    physics.close()
    for recorder in recorders:
        recorder.close()
    return party, track
