"""The demonstration in virtual time: one process, the same server, rover and third party."""

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Recording, Settings
from mav_tasks.links.memory import MemoryLink, MemoryNet
from mav_tasks.recording import observers
from mav_tasks.shell.in_memory import CLIENT_LINK, InMemoryServer
from rover_sim.body import Body, Pose
from rover_sim.bullet import BulletBody
from rover_sim.demo.screen import Screen
from rover_sim.demo.third_party import Place, ThirdParty
from rover_sim.kinematic import KinematicBody
from rover_sim.vehicle import Vehicle, make_vehicle
from rover_sim.virtual import RoverParty, VirtualWorld

TIME_LIMIT = 85.0  # virtual s
TRACK_INTERVAL = 0.1  # virtual s
START = Pose()


def drive(screen: Screen, *, body: str, seed: int, record: str) -> tuple[ThirdParty, list[Place]]:
    """Run server, rover and third party; return the third party and the true track.

    ``record`` is the folder for a record of the server's decisions, "" for none.
    """
    settings = Settings()
    recorders = observers(Recording(decisions=record), settings, None, now=0.0)
    net = MemoryNet()
    vehicle = make_vehicle(_body(body, seed), system_id=1, now=0.0, seed=seed)
    world = VirtualWorld(net)
    member = _Member(net.link("third party"), vehicle, screen)
    rover = RoverParty(vehicle, net.link("rover"))
    server = InMemoryServer(net, vehicles=("rover",), settings=settings, observers=recorders)
    world.join(rover, server, member)
    track: list[Place] = []

    def follow(now: float) -> None:
        if now >= TRACK_INTERVAL * len(track):
            track.append(member.truth())

    world.watch(follow)
    if not world.run_until(lambda: member.party.is_over, within=TIME_LIMIT):
        screen.say(f"gave up after {TIME_LIMIT:.0f} s of virtual time")
    screen.update(member.party)
    vehicle.body.close()
    for recorder in recorders:
        recorder.close()
    return member.party, track


class _Member:
    """The third party as a party of the virtual world."""

    def __init__(self, link: MemoryLink, vehicle: Vehicle, screen: Screen) -> None:
        self._link = link
        self._vehicle = vehicle
        self._screen = screen
        self._mav = common.MAVLink(self, srcSystem=255, srcComponent=190)
        self._mav.robust_parsing = True
        self._now = 0.0
        self.party = ThirdParty(self._mav, self.truth, self._say)

    def write(self, data: bytes) -> None:
        """Send bytes; pymavlink calls this on its file object."""
        self._link.send(CLIENT_LINK, bytes(data))

    def truth(self) -> Place:
        """Return the true pose of the rover."""
        state = self._vehicle.truth
        return Place(state.north, state.east, state.yaw)

    def next_deadline(self) -> float:
        """Return the next turn's time, at 10 Hz."""
        return self._now + 0.1

    def turn(self, *, now: float) -> None:
        """Read messages, then send those that are due."""
        for _, data in self._link.receive(len(self._link.arrived)):
            for message in self._mav.parse_buffer(data) or ():
                self.party.take(message)
        if now >= self.next_deadline() or self._now == 0.0:
            self._now = now
            self.party.step(now)
            self._screen.update(self.party)

    def _say(self, text: str) -> None:
        self._screen.say(f"{self._now:6.1f} s  {text}")


def _body(kind: str, seed: int) -> Body:
    if kind == "kinematic":
        return KinematicBody(start=START, slip=0.3, seed=seed or None)
    return BulletBody(start=START, variation=0.3 if seed else 0.0, seed=seed)
