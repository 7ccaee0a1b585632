"""Attack S9: one client's stream of requests must not cost the others their answers.

A rover answers the requests for its messages one by one, over a radio ten a second.
"""

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskReason as R
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, REQUEST, TEMPORARILY_REJECTED, FakeClient, command_long
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

#: 50 ms each way, as a radio of 57,600 baud has it
RADIO = Conditions(delay=0.05)
AUTOPILOT_VERSION, BATTERY = 148, 147
FLOOD = 150.0  # requests a second
MAX_EACH = 4  # requests of one client that wait for a rover
OBSERVER, OPERATOR = 9, 12  # system ids
#: one message, for which requests can be shared, and fifty, for which none can
FLOODS = for_each("messages", [(BATTERY,), tuple(range(200, 250))])
ADDRESSES = {"9/190": "observer", "10/190": "observer", "12/190": "operator"}


def request_of(message_id: int) -> common.MAVLink_command_long_message:
    return command_long(REQUEST, message_id, target=(1, 1))


def flooded(make_world: MakeWorld, messages: tuple[int, ...]) -> World:
    """Return a world in which an observer asks for messages 150 times a second."""
    settings = Settings(roles=Roles(addresses=ADDRESSES))
    world = make_world(settings=settings, conditions=RADIO)
    flooder = world.add_client("flooder", system_id=OBSERVER)
    world.run(2.0)
    for message_id in messages:
        flooder.stream(request_of(message_id), rate=FLOOD / len(messages))
    world.run(3.0)
    return world


def answers(world: World, client: FakeClient, *, count: int = 20) -> list[int | None]:
    """Ask so many times, half a second apart, for another message; give the results."""
    results: list[int | None] = []
    for _ in range(count):
        sent = client.command(REQUEST, AUTOPILOT_VERSION, target=(1, 1))
        world.run(0.7)
        results.append(sent.result)
    return results


@FLOODS
def test_an_operators_requests_are_answered_beside_an_observers_flood(
    make_world: MakeWorld, messages: tuple[int, ...]
) -> None:
    world = flooded(make_world, messages)
    operator = world.add_client("operator", system_id=OPERATOR)
    world.run(2.0)
    assert answers(world, operator) == [ACCEPTED] * 20


def test_what_is_too_much_is_called_busy_and_never_unsupported(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(roles=Roles(addresses=ADDRESSES)), conditions=RADIO)
    flooder = world.add_client("flooder", system_id=OBSERVER)
    world.run(2.0)
    for message_id in range(1, 50):  # of which nothing can be joined
        flooder.command(REQUEST, message_id, BATTERY, target=(1, 1))
    world.run(0.15)  # the rover has not answered yet
    busy = (TEMPORARILY_REJECTED, R.RATE_LIMITED)
    assert flooder.acks_of(REQUEST) == [busy] * (49 - MAX_EACH)
    world.run(2.0)
    told = flooder.texts()
    assert any("busy" in text for text in told), told


@for_each("message_id", [BATTERY, AUTOPILOT_VERSION])
def test_the_rover_is_not_asked_more_often_than_it_answers(
    make_world: MakeWorld, message_id: int
) -> None:
    world = make_world(settings=Settings(roles=Roles(addresses=ADDRESSES)), conditions=RADIO)
    clients = [world.add_client(f"client {n}", system_id=OBSERVER) for n in range(8)]
    world.run(2.0)
    asked = 0

    def count(_source: str, target: str, data: bytes) -> bool:
        nonlocal asked
        asked += target == "rover1" and data[7] == 76 and data[10 + 28] == REQUEST & 0xFF
        return False

    world.watched.loses = count
    sent = [client.command(REQUEST, message_id, target=(1, 1)) for client in clients]
    world.run(1.0)
    assert [each.result for each in sent] == [ACCEPTED] * 8
    assert asked <= 2, f"one question for all of them, and one in flight: {asked}"
