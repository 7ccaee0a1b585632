"""A session of file transfer is ended by its number, whoever says it: not while somebody writes."""

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from tests.kit.cases import anew, for_each
from tests.kit.client import FakeClient
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_roles import join

FILE_TRANSFER = 110
TERMINATE, OPEN_TO_READ, READ, WRITE = 1, 4, 5, 7
OBSERVER, SAFETY = 9, 13  # system ids


@anew
def world(make_world: MakeWorld) -> World:
    roles = Roles(unsigned="safety", addresses={"9/190": "observer"})
    return make_world(settings=Settings(roles=roles))


def request(client: FakeClient, opcode: int) -> None:
    payload = [0, 0, 0, opcode] + [0] * 247  # of session 0
    client.send(common.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))


@for_each("why", ["it has ended", "it was given up", "nobody writes", "it writes"])
def test_an_observer_ends_what_it_reads(world: World, why: str) -> None:
    writer, observer = join(world, SAFETY), join(world, OBSERVER)
    if why != "nobody writes":
        request(writer, WRITE)
    if why == "it has ended":
        request(writer, TERMINATE)
    world.run(11.0 if why == "it was given up" else 0.1)
    for opcode in (OPEN_TO_READ, READ):
        request(observer, opcode)
    world.run(0.1)
    passed = world.passed_on((OBSERVER, 190))
    request(observer, TERMINATE)
    world.run(0.1)
    assert (FILE_TRANSFER in passed) is (why != "it writes")
