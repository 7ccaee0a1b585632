"""Every world of a scenario is checked at its end, whether the scenario thinks of it or not."""

from collections.abc import Iterator
from typing import Any, Protocol

import pytest

from tests.kit.cases import anew
from tests.kit.fleet import Fleet, Layout
from tests.kit.joint.agreement import Agreement
from tests.kit.needs import Needs
from tests.kit.world import World


class MakeWorld(Protocol):
    """Makes a world (see World) whose observers are asked at the end of the test."""

    def __call__(self, **kw: Any) -> World: ...


@pytest.fixture(autouse=True)
def needs(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Hold the timers of every engine against what its parts need."""
    looked = Needs()
    looked.look_on(monkeypatch)
    yield
    if looked.surprises:
        told = "\n".join(looked.surprises)
        pytest.fail(f"the engine's timers do not know of this:\n{told}")


@pytest.fixture
def make_world(monkeypatch: pytest.MonkeyPatch) -> Iterator[MakeWorld]:
    """Return a factory of worlds that are ready to be used."""
    worlds: list[World] = []
    agreement = Agreement()
    agreement.look_on(monkeypatch)

    def make(**kw: Any) -> World:
        world = World(**kw)
        worlds.append(world)
        print(f"world {len(worlds)}: seed {world.seed}")
        return world.ready()

    yield make
    for world in worlds:
        world.check()
    if agreement.surprises:
        told = "\n".join(agreement.surprises)
        pytest.fail(f"the model of joint control does not know of this:\n{told}")


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
