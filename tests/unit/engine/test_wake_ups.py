"""A wake-up does what is due and nothing else."""

from random import Random

import pytest

from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.in_memory import CLIENT_LINK
from mav_tasks.mavlink import messages as m
from tests.kit.world import World

SET_RELAY = 181  # a command that a plan may order


@pytest.mark.parametrize("seed", range(3))
def test_a_wake_up_for_nothing_does_nothing(seed: int) -> None:
    world, random, idle = World(seed=seed).ready(), Random(seed), 0
    for _ in range(10):
        world.client.move(random.uniform(-1, 1), nonce=random.randrange(1, 10**6))
        for _ in range(50):
            world.run(random.uniform(0.0, 0.2))
            idle += _wakes_for_nothing(world)
    assert idle > 100


def _wakes_for_nothing(world: World) -> bool:
    """Whether nothing was due: then nothing must come of a wake-up."""
    engine = world.server.engine
    due = engine.next_deadline()
    assert due is not None
    if due <= world.now:
        return False
    before = engine.snapshot(now=world.now)
    engine.handle_deadline(now=world.now)
    assert (engine.take_packets(), engine.take_events()) == ([], [])
    assert (engine.next_deadline(), engine.snapshot(now=world.now)) == (due, before)
    return True


def test_what_is_done_to_a_vehicle_when_all_was_looked_at_counts_as_well() -> None:
    world = World().ready()
    engine = world.server.engine
    before, vehicle = engine.next_deadline(), engine._vehicles.get(1)
    assert before is not None
    assert vehicle is not None
    relay = m.CommandLong(1, 1, SET_RELAY, 0, 0, 1, 0, 0, 0, 0, 0)
    vehicle.requests.perform(relay, now=world.now - 1.0)
    assert engine.next_deadline() == vehicle.next_deadline() < before


def test_a_client_that_is_gone_is_told_nothing() -> None:
    world = World().ready()
    engine = world.server.engine
    (client,) = engine._gcs.clients
    client.statuses.set_interval(1, 60.0, now=world.now)
    world.run(0.5)
    assert engine._telling.at == world.now - 0.5 + 60.0
    engine.handle(LinkChanged(CLIENT_LINK, LinkSide.CLIENTS, up=False), now=world.now)
    assert engine._telling.at == float("inf")
