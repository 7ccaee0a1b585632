"""A wake-up does what is due and nothing else."""

from random import Random

import pytest

from tests.kit.world import World


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
