"""A server, or a gateway, that meets a rover while it drives brakes it by set-points before HOLD.

In HOLD an ArduPilot car rolls on for 3 m, and a PX4 car drives a loop of 5 m (measured on real
ones); by set-points each stands within 1.2 m.
"""

from functools import partial
from pathlib import Path

import pytest

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.frames import Frame
from rover_sim.personas import Mode, Persona
from tests.kit.car import Car
from tests.kit.cases import anew, for_each
from tests.kit.px4 import PROMPT_PX4
from tests.kit.restarts import UTC, restart
from tests.kit.store import PromptSqliteStore
from tests.kit.world import PROMPT, World
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_restart import REMAINDER, release

AWAY = 0.4  # s, of a server that a supervisor starts again at once

CARS = {
    "ArduPilot car": PROMPT.on(Frame.ACKERMANN),
    "PX4 car": PROMPT_PX4.on(Frame.ACKERMANN),
}
OTHERS = {"ArduPilot": PROMPT, "PX4": PROMPT_PX4}
EVERY = {**OTHERS, **CARS}

personas = for_each("persona", EVERY.values())


@anew
def path(tmp_path: Path) -> Path:
    return tmp_path / "tasks.sqlite3"


def driving(make_world: MakeWorld, path: Path, persona: Persona) -> World:
    """Return a world in which a task drives at 1 m/s."""
    store = PromptSqliteStore(path, wall_offset=UTC)
    world = make_world(persona=persona, body=partial(Car, radius=1.2), store=store)
    if "COM_OF_LOSS_T" in world.rover.autopilot.parameters:
        world.rover.autopilot.parameters["COM_OF_LOSS_T"] = 5.0  # it still drives when it is met
    world.client.move(20, speed=1.0)
    world.until_faster(0.9)
    world.until(lambda: world.now % 1.0 < 0.05, within=1.1)  # positions precede its next heartbeat
    return world


def in_control_mode(world: World) -> bool:
    return world.mode() is Mode.GUIDED  # OFFBOARD


def phase_of(world: World) -> str:
    """Return the phase of the server's control, "" before it has met the rover."""
    found = world.server.engine.snapshot(now=world.now).vehicles
    return found[0].control if found else ""


def stands(world: World) -> bool:
    """Return whether it stands, or is a car that rolls on in HOLD by 0.2 m at the most."""
    return abs(world.truth.forward_speed) < 0.1


class Met:
    """What a rover did from the moment in which a new server met it."""

    def __init__(self, world: World, path: Path, *, away: float = AWAY) -> None:
        self.world = world
        restart(world, path, away=away, settles=0.0)
        assert world.truth.forward_speed > 0.7
        self.began, self.north = world.now, world.truth.north
        self.slow_at: float | None = None
        self.held_at: float | None = None
        world.watch(self._look)

    def _look(self, now: float) -> None:
        if self.slow_at is None and abs(self.world.truth.forward_speed) < 0.15:
            self.slow_at = now
        if self.held_at is None and "HOLD" in self.world.observer.sent_since(self.began):
            self.held_at = now

    def stands(self, *, within: float = 4.0) -> None:
        """Run until it has stopped and got HOLD, in this order, and stands."""
        self.world.until(lambda: self.held_at is not None and stands(self.world), within=within)
        assert self.slow_at is not None
        assert self.held_at is not None
        assert self.slow_at <= self.held_at
        assert self.world.truth.north - self.north < 2.2  # up to 1 s until its next heartbeat


@personas
def test_it_is_braked_and_gets_hold_when_it_stands(
    make_world: MakeWorld, path: Path, persona: Persona
) -> None:
    world = driving(make_world, path, persona)
    met = Met(world, path)
    met.stands()
    assert world.state(1) == (S.HELD, R.OUTCOME_UNKNOWN)
    world.run(3)
    assert not in_control_mode(world)
    assert stands(world)
    release(world, 1, REMAINDER)
    world.client.proceed()
    world.until_idle(tasks=1, within=60)
    assert world.state(1)[0] is S.COMPLETED
    assert abs(world.truth.north - 20.0) < 0.3


@personas
def test_without_a_position_it_gets_hold_soon(
    make_world: MakeWorld, path: Path, persona: Persona
) -> None:
    """Nobody sees whether set-points stop it; a PX4 stands by its heading, which nobody knows."""
    world = driving(make_world, path, persona)
    # from here on only its heartbeats come
    world.watched.loses = lambda source, _target, data: source == "rover1" and data[7] != 0
    restart(world, path, away=AWAY, settles=0.0)
    at = world.now
    words = ["RELEASING"] if persona.autopilot == PROMPT_PX4.autopilot else ["CONTROL", "RELEASING"]
    since: dict[str, float] = {}  # by phase
    world.watch(lambda now: since.update({phase_of(world): since.get(phase_of(world), now)}))
    world.until(lambda: "RELEASING" in since, within=2.2)
    assert [phase for phase in since if phase] == words
    assert "HOLD" in world.observer.sent_since(at)
    blind = since["RELEASING"] - since.get("CONTROL", since["RELEASING"])
    assert blind == pytest.approx(1.0 if "CONTROL" in words else 0.0, abs=0.06)
    world.until(lambda: not in_control_mode(world), within=1.0)


def test_who_switches_it_to_manual_meanwhile_has_it(make_world: MakeWorld, path: Path) -> None:
    world = driving(make_world, path, PROMPT)
    Met(world, path)
    world.until(lambda: phase_of(world) == "CONTROL", within=1.5)
    world.operator_mode(Mode.MANUAL)
    at = world.now
    world.run(3)
    assert phase_of(world) == "IDLE"
    assert world.mode() is Mode.MANUAL
    assert "HOLD" not in world.observer.sent_since(at + 1.1)  # after its next heartbeat
