"""Too much of everything: who floods the server is left out, and everybody else is served."""

from itertools import count

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Clients, Limits, Roles, Settings
from mav_tasks.engine.inputs import SettingsChanged
from mav_tasks.links.memory import MemoryLink
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    REQUEST,
    SET_INTERVAL,
    FakeClient,
    command_long,
    heartbeat,
    packed,
)
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

STOP = 54003
FLOOD = 600  # datagrams in a moment


def counts(world: World) -> str:
    return world.server.engine.snapshot(now=world.now).decoded


def strangers(world: World, number: int, *messages: bytes) -> list[MemoryLink]:
    """Let so many endpoints send something, each once."""
    links = []
    for _ in range(number):
        link = world.net.link(f"stranger {next(_NAMES)}")
        for message in messages:
            link.send(world.client.server, message)
        links.append(link)
    return links


_NAMES = count()


def test_of_a_client_s_flood_so_much_is_looked_at_and_stop_always(make_world: MakeWorld) -> None:
    world = make_world()
    other = world.add_client("other", system_id=9)
    world.run(1.5)
    limited = Settings(clients=Clients(packet_rate=100.0))
    world.server.pump.handle(SettingsChanged(limited), now=world.now)
    for _ in range(FLOOD):
        world.client.send_raw(b"\xfdnoise")
    late = world.client.move(1.0)
    world.client.stop()
    older = command_long(STOP).pack(common.MAVLink(None, 255, 190), force_mavlink1=True)
    world.client.send_raw(older)
    served = other.move(2.0)
    world.run(0.2)
    assert late.ack is None
    assert world.client.acks_of(STOP) == [(ACCEPTED, 0)] * 2
    assert served.result == ACCEPTED
    assert "dropped 50" in counts(world)
    world.run(2.0)
    world.client.proceed()
    again = world.client.rotate(10.0)
    world.run(0.2)
    assert again.result == ACCEPTED


def test_strangers_drive_nobody_out_and_their_stop_counts(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(clients=Clients(max_clients=8)))
    others = [world.add_client(f"other {n}", system_id=20 + n) for n in range(4)]
    world.run(2.0)
    task = world.client.move(20.0)
    crowd: list[MemoryLink] = []
    for _ in range(20):
        crowd += strangers(world, 20, packed(heartbeat(), 77, 190))
        world.run(0.5)
    sent = [client.request_status(task.task_id) for client in (world.client, *others)]
    world.run(0.2)
    assert [each.result for each in sent] == [ACCEPTED] * 5
    assert len(list(world.server.engine.snapshot(now=world.now).clients)) <= 8
    assert 30 not in {data[7] for link in crowd for _, data in link.receive(100)}, "no telemetry"
    (link,) = strangers(world, 1, packed(command_long(STOP), 77, 190))
    world.until_state(task.task_id, S.KILLED, within=1.0)
    world.run(0.1)
    assert any(data[7] == 77 for _, data in link.receive(100)), "it is answered, too"


@for_each("kind", ["commands", "uploads", "requests", "parameters", "noise"])
def test_what_others_are_served_and_what_is_remembered(make_world: MakeWorld, kind: str) -> None:
    """A rover is driven meanwhile: no setpoint is missing (the observer looks), STOP stops it."""
    world = make_world(settings=Settings(roles=Roles(safety=Limits(rate=20.0))))
    flooder = world.add_client("flooder", system_id=66)
    other = world.add_client("other", system_id=9)
    world.run(1.5)
    task = other.move(6.0)
    world.until_state(task.ack.result_param2 if task.ack else 1, S.EXECUTING)
    sizes = []
    for turn in range(8):
        for number in range(300):
            flood(flooder, kind, turn * 300 + number)
        world.run(0.5)
        asked = other.request_status(1)
        world.run(0.1)
        assert asked.result == ACCEPTED
        sizes.append(len(world.server.engine.snapshot(now=world.now).tasks))
    assert sizes[-1] <= 1 + 100 + 20 * 5
    stop = other.stop()
    world.until_state(1, S.KILLED, within=1.0)
    assert stop.result == ACCEPTED
    world.until(world.stands, within=3.0)


def flood(client: FakeClient, kind: str, number: int) -> None:
    match kind:
        case "commands":
            client.send(command_long(54000, 1.0, 0, 0, number + 1, 0, 0, 5))
        case "uploads":
            target = (1, (1, 191)[number % 2])
            client.send(common.MAVLink_mission_count_message(*target, 1000, number % 3))
        case "requests":
            wanted = number % 400
            if number % 2:
                client.send(command_long(SET_INTERVAL, wanted, 1, target=(1, 1)))
            else:
                client.send(command_long(REQUEST, wanted, target=(1, 1)))
        case "parameters":
            value = 0.1 + number % 7 / 10
            client.send(common.MAVLink_param_set_message(1, 191, b"TSK_SPEED", value, 9))
        case _:
            client.send_raw(bytes(number % 256 for _ in range(number % 280)))
