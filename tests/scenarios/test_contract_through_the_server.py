"""A rover behind the server is still one: check_vehicle judges what a client sees of it.

All that the checker may do to a rover it does: it arms, drives by setpoints of its own, uploads.
"""

from mav_tasks.shell.in_memory import CLIENT_LINK
from rover_sim.check_vehicle.context import Options
from rover_sim.check_vehicle.contract import check_vehicle
from rover_sim.personas import PERSONAS, Mode
from tests.kit.cases import for_each
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

EVERYTHING = Options(arm=True, drive=True, write=True)
#: the server owns the rates on the vehicle link, and takes any interval for itself
KNOWN = {"interval of an unknown message"}


class WorldWire:
    """Implements check_vehicle's ``Wire``: one more client of the server."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._link = world.net.link("checker")

    def now(self) -> float:
        return self._world.now

    def send(self, data: bytes) -> None:
        self._link.send(CLIENT_LINK, data)

    def receive(self, within: float) -> bytes:
        self._world.run_until(lambda: bool(self._link.arrived), within=within)
        return b"".join(data for _, data in self._link.receive(1))


@for_each("name", PERSONAS)
def test_a_rover_behind_the_server_passes_as_it_does_without(
    make_world: MakeWorld, name: str
) -> None:
    world = make_world(persona=PERSONAS[name])
    report = check_vehicle(WorldWire(world), EVERYTHING, system_id=1, show=lambda _line: None)
    assert {line.name for line in report.failed} == KNOWN, [str(each) for each in report.failed]
    assert (world.mode(), world.is_armed) == (Mode.HOLD, False)
