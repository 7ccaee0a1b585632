"""Every world of a scenario is checked at its end, whether the scenario thinks of it or not."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import pytest

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.testing.options import RoverOptions
from rover_sim.testing.rover_world import RoverWorld
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


@anew
def driving(world: World) -> World:
    """Return a world in which a task drives and another waits."""
    world.client.move(4)
    world.until_state(1, S.EXECUTING)
    world.client.rotate(90)
    world.run(2)
    assert world.truth.forward_speed > 0.3
    return world


@anew
def path(tmp_path: Path) -> Path:
    """Return where a store is."""
    return tmp_path / "tasks.sqlite3"


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


class MakeRoverWorld(Protocol):
    """Makes a world of scripts that use the client library (see RoverWorld)."""

    def __call__(
        self, *, seed: int = 1, settings: Settings | None = None, **options: Any
    ) -> RoverWorld: ...


@pytest.fixture
def make_rover_world() -> Iterator[MakeRoverWorld]:
    """Return a factory of worlds with a server that is ready."""
    worlds: list[RoverWorld] = []

    def make(*, seed: int = 1, settings: Settings | None = None, **options: Any) -> RoverWorld:
        world = RoverWorld(RoverOptions(**options), seed=seed, settings=settings or Settings())
        worlds.append(world)
        world.server.start()
        world.until(lambda: world.server.is_ready)
        return world

    yield make
    for world in worlds:
        world.close()
