"""A fleet at work: its server keeps no more in the end than after the half."""

from random import Random

import pytest

from mav_tasks.config.settings import Clients, Settings
from tests.kit.bounds import entries
from tests.scenarios.conftest import MakeWorld

QUARTER = 60.0  # s
GROWTH = 1.06  # limit on entries in the end, relative to the half
FULL = 260  # commands of a client; the server remembers 256


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_memory_stays_what_it_was(make_world: MakeWorld) -> None:
    random = Random(1)
    settings = Settings(clients=Clients(stream_interval=1.0), on_failure="continue")
    world = make_world(settings=settings)
    clients = [world.client, *(world.add_client(f"{n}", system_id=100 + n) for n in range(3))]
    for number in range(FULL):
        for client in clients:
            client.request_status(number + 1)
        world.run(0.02)
    sizes: list[int] = []
    for quarter in range(1, 5):
        while world.now < quarter * QUARTER:
            client = random.choice(clients)
            match random.randrange(7):
                case 0 | 1 | 2:
                    client.move(random.choice((-0.3, 0.3)), nonce=random.randrange(1, 1 << 24))
                case 3:
                    client.request_status(random.randrange(1, 200))
                case 4:
                    client.pause()
                case 5:
                    client.stop(clear=True)
            if random.random() < 0.5:
                client.proceed()
            world.run(1.0)
        sizes.append(entries(world.server.engine))
    assert sizes[-1] <= GROWTH * sizes[1], sizes
