"""Worlds as the plugin's fixtures give them, without the plugin: it is not loaded here."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from mav_tasks.config.settings import Settings
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld

MakeWorld = Callable[..., RoverWorld]


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Return a factory of worlds; its arguments are those of the marker."""
    worlds: list[RoverWorld] = []

    def make(*, seed: int = 1, settings: Settings | None = None, **options: Any) -> RoverWorld:
        world = RoverWorld(RoverOptions(**options), seed=seed, settings=settings or Settings())
        worlds.append(world)
        return world

    yield make
    for world in worlds:
        world.close()


@pytest.fixture
def world(make_world: MakeWorld) -> RoverWorld:
    """Return a world with one rover of the default kind."""
    return make_world()
