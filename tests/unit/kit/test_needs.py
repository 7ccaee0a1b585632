"""The look at the engine's timers finds what it is there for."""

from math import inf

import pytest

from mav_tasks.engine.inputs import LinkChanged, LinkSide
from mav_tasks.engine.timers import Timer
from tests.kit.needs import Needs
from tests.kit.world import World


def test_nothing_is_found_in_a_server_that_idles(monkeypatch: pytest.MonkeyPatch) -> None:
    needs = Needs()
    needs.look_on(monkeypatch)
    World().ready().run(5)
    assert needs.surprises == []


@pytest.mark.patches_core
def test_a_timer_that_is_not_set_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    world, needs = World().ready(), Needs()
    needs.look_on(monkeypatch)
    monkeypatch.setattr(Timer, "set", lambda *_: None)
    world.run(5)
    assert needs.surprises


def test_a_timer_that_comes_for_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    world, needs = World().ready(), Needs()
    needs.look_on(monkeypatch)
    engine = world.server.engine
    engine._stopping.set(world.now)
    engine.handle(LinkChanged("another", LinkSide.CLIENTS, up=True), now=world.now)
    assert needs.surprises
    engine._stopping.set(inf)
