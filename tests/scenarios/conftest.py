"""Every world of a scenario is checked at its end, whether the scenario thinks of it or not."""

from collections.abc import Iterator
from typing import Any, Protocol

import pytest

from tests.kit.cases import anew
from tests.kit.fleet import Fleet, Layout
from tests.kit.world import World


class MakeWorld(Protocol):
    """Makes a world (see World) whose observers are asked at the end of the test."""

    def __call__(self, **kw: Any) -> World: ...


@pytest.fixture
def make_world() -> Iterator[MakeWorld]:
    """Return a factory of worlds that are ready to be used."""
    worlds: list[World] = []

    def make(**kw: Any) -> World:
        world = World(**kw)
        worlds.append(world)
        print(f"world {len(worlds)}: seed {world.seed}")
        return world.ready()

    yield make
    for world in worlds:
        world.check()


@anew
def world(make_world: MakeWorld) -> World:
    """Return a world in which nothing is unusual."""
    return make_world()


class MakeFleet(Protocol):
    """Makes a fleet (see Fleet) whose observers are asked at the end of the test."""

    def __call__(self, layout: Layout, **kw: Any) -> Fleet: ...


@pytest.fixture
def make_fleet() -> Iterator[MakeFleet]:
    """Return a factory of fleets that are ready to be used."""
    fleets: list[Fleet] = []

    def make(layout: Layout, **kw: Any) -> Fleet:
        fleet = Fleet(layout, **kw)
        fleets.append(fleet)
        fleet.ready()
        return fleet

    yield make
    for fleet in fleets:
        fleet.check()
