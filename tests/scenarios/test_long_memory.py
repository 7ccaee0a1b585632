"""A fleet at work: its server has no more in memory in the end than after the first quarter.

The hour of 5 rovers and 10 clients takes minutes: ``tools/soak.py --hour``. Here are fewer rovers
and less time, by the same code.
"""

import pytest

from tests.kit.soak.hour import Hour, HourSettings
from tests.kit.world import World

SHORT = HourSettings(seconds=200.0, rovers=1, clients=10, kept=5)
SHORTER = HourSettings(seconds=80.0, rovers=1, clients=3, kept=3)


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(180)
def test_memory_stays_what_it_was() -> None:
    for line in Hour(SHORT, seed=1).run():
        print(line)


@pytest.mark.volume
@pytest.mark.slow
@pytest.mark.timeout(180)
def test_a_leak_is_noticed() -> None:
    def leak(world: World) -> None:
        world.server.engine.__dict__.setdefault("leak", []).append(f"{world.now}" * 100)

    with pytest.raises(AssertionError, match="memory has grown by a factor of"):
        list(Hour(SHORTER, seed=1).run(leak=leak))
