"""PX4's offboard-loss failsafe: it ends by itself when setpoints return, and drives on with what it
was told last. Nothing of ours may wake it, and its HOLD is not one that somebody asked for.
"""

from pathlib import Path
from shutil import copy
from typing import Any

import pytest

from mav_tasks.links.memory import Conditions
from mav_tasks.settings import Settings
from mav_tasks.tasks.events import VehicleNoted
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, TEMPORARILY_REJECTED
from tests.kit.px4 import HOLD, PROMPT_PX4, SET_MODE, ask_mode
from tests.kit.store import PromptSqliteStore
from tests.kit.world import COMMAND_ID, MODE_COMMAND, World
from tests.scenarios.conftest import MakeWorld

RELEASE, AGAIN = 54013, 0


def driving(make_world: MakeWorld, *, speed: float = 1.5, lost: float = 1.0, **kw: Any) -> World:
    """A rover that a task drives; without setpoints it stops after ``lost`` seconds."""
    kw.setdefault("persona", PROMPT_PX4)
    world = make_world(**kw)
    world.rover.autopilot.parameters["COM_OF_LOSS_T"] = lost
    world.client.move(60, speed=speed)
    world.until(lambda: world.truth.forward_speed > speed - 0.06, within=20)
    return world


def is_mode_request(data: bytes) -> bool:
    return data[7] == MODE_COMMAND and data[COMMAND_ID] == SET_MODE.to_bytes(2, "little")


@for_each("lost", [1.0, 5.0])
def test_a_server_that_is_started_again_leaves_it_standing(
    make_world: MakeWorld, tmp_path: Path, lost: float
) -> None:
    path = tmp_path / "tasks.sqlite3"
    store = PromptSqliteStore(path, wall_offset=1.8e9)
    world = driving(make_world, store=store, lost=lost)
    world.end_server()
    again = copied(path)
    store.close()
    world.run(lost + 4)
    assert world.stands()
    where = world.truth.north
    later = PromptSqliteStore(again, wall_offset=1.8e9)
    world.start_server(later, later.load())
    world.run(10)
    assert abs(world.truth.north - where) < 0.1
    assert world.stands()
    assert world.paused() is R.RESTARTED


@for_each("lost", [1.0, 5.0])
def test_a_server_whose_machine_slept_leaves_it_standing(
    make_world: MakeWorld, lost: float
) -> None:
    world = driving(make_world, persona=PX4, lost=lost)
    world.observer.expects_gaps = True
    world.suspend_server(lost + 3.5)
    assert world.stands()
    where = world.truth.north
    world.run(lost + 4)
    assert abs(world.truth.north - where) < 0.2


@for_each("persona", [PX4, PROMPT_PX4])
@for_each("lost", [1.0, 5.0])
def test_once_a_takeover_is_told_it_does_not_drive_on(
    make_world: MakeWorld, lost: float, persona: Persona
) -> None:
    conditions = Conditions(delay=0.15)
    world = driving(
        make_world,
        speed=2.0,
        lost=lost,
        persona=persona,
        conditions=conditions,
        shows_on_request=False,
    )
    world.run(0.4)
    end = world.now + lost + 0.15  # just long enough for the failsafe
    world.watched.loses = lambda source, target, data: target == "rover1" and world.now < end
    world.until(lambda: world.paused() is R.FAILSAFE, within=lost + 4)
    told = world.truth.north
    world.run(lost + 4)
    assert world.stands()
    # braking from 2 m/s takes 2.2 m, and 0.3 s of the net 0.6 m
    assert world.truth.north - told < 3.6


def test_its_hold_is_not_taken_for_one_that_was_asked_for(make_world: MakeWorld) -> None:
    world = driving(make_world, lost=5.0)
    world.watched.loses = lambda source, target, data: target == "rover1"
    world.run(9)
    assert world.stands()
    until = world.now + 0.8
    world.watched.loses = lambda source, target, data: (
        target == "rover1" and world.now < until and is_mode_request(data)
    )
    world.client.proceed()
    seen = set()
    for _ in range(40):
        world.run(0.05)
        seen.add((world.control(), world.rover.autopilot.mode))
    assert not seen & {("IDLE", Mode.GUIDED), ("LEADING_IN", Mode.GUIDED)}


def test_a_server_that_stalls_while_zeros_stream_begins_that_again(make_world: MakeWorld) -> None:
    world = make_world(persona=PROMPT_PX4)
    world.client.move(2)
    world.until(lambda: world.control() == "LEADING_IN", within=5)
    world.run(0.3)
    world.suspend_server(0.4)
    world.run(8)
    assert world.state(1)[0] in (S.EXECUTING, S.COMPLETED)


class TestOneThatDrivesHomeWithoutUs:
    """Its failsafe is accepted as it is, and the server is killed while it drives."""

    @pytest.fixture
    def world(self, make_world: MakeWorld, tmp_path: Path) -> World:
        self.path = tmp_path / "tasks.sqlite3"
        store = PromptSqliteStore(self.path, wall_offset=1.8e9)
        settings = Settings(loss_failsafe="accept")
        world = make_world(persona=PROMPT_PX4, store=store, settings=settings)
        world.rover.autopilot.parameters["COM_OBL_RC_ACT"] = 3
        world.client.move(60, speed=1.5)
        world.run(14)
        return world

    def restart(self, world: World, *, away: float) -> None:
        world.end_server()
        again = copied(self.path)
        world.server.store.close()
        world.run(away)
        assert world.rover.autopilot.mode is Mode.RTL
        later = PromptSqliteStore(again, wall_offset=1.8e9)
        world.start_server(later, later.load())

    def test_a_server_that_is_started_meanwhile_sends_it_no_setpoint(self, world: World) -> None:
        self.restart(world, away=2.5)
        began = world.now
        world.run(5)
        assert world.rover.autopilot.mode is Mode.RTL
        assert "zero" not in world.observer.sent_since(began)
        noted = [event.text for event in world.events(VehicleNoted)]
        assert noted[0].startswith("is in Return (failsafe or a person): mode not changed")

    def test_what_is_refused_says_the_way_out_and_that_is_one(self, world: World) -> None:
        self.restart(world, away=2.5)
        world.run(4.0)
        refused = world.client.command(RELEASE, 1, AGAIN)
        world.run(0.2)
        assert refused.answer == (TEMPORARILY_REJECTED, R.WRONG_MODE)
        assert any("wrong mode, set HOLD first" in text for text in world.client.texts())
        ask_mode(world.client, HOLD)
        world.until(world.stands, within=5)
        released = world.client.command(RELEASE, 1, AGAIN)
        world.run(0.2)
        assert released.answer == (ACCEPTED, 1)
        world.client.proceed()
        world.until_state(1, S.EXECUTING)


def copied(path: Path) -> Path:
    """What is on the disk of a server that is gone."""
    again = path.with_name("again.sqlite3")
    for suffix in ("", "-wal"):
        if Path(f"{path}{suffix}").exists():
            copy(f"{path}{suffix}", f"{again}{suffix}")
    return again
