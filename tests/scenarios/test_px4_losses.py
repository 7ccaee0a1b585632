"""PX4's offboard-loss failsafe: it ends by itself when setpoints return, and drives on with what it
was told last. Nothing of ours may wake it, and its HOLD is not one that somebody asked for.
"""

from pathlib import Path
from typing import Any

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.events import VehicleNoted
from rover_sim.personas import PX4, Mode
from tests.kit.cases import for_each
from tests.kit.px4 import PROMPT_PX4, SET_MODE
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import PromptSqliteStore
from tests.kit.world import COMMAND_ID, MODE_COMMAND, World
from tests.scenarios.conftest import MakeWorld


def driving(make_world: MakeWorld, *, speed: float = 1.5, lost: float = 1.0, **kw: Any) -> World:
    """A rover that a task drives; without setpoints it stops after ``lost`` seconds."""
    kw.setdefault("persona", PROMPT_PX4)
    world = make_world(**kw)
    world.rover.autopilot.parameters["COM_OF_LOSS_T"] = lost
    world.client.move(60, speed=speed)
    world.until_faster(speed - 0.06)
    return world


def is_mode_request(data: bytes) -> bool:
    return data[7] == MODE_COMMAND and data[COMMAND_ID] == SET_MODE.to_bytes(2, "little")


@for_each("lost", [1.0, 5.0])
def test_a_server_that_is_started_again_leaves_it_standing(
    make_world: MakeWorld, path: Path, lost: float
) -> None:
    store = PromptSqliteStore(path, wall_offset=UTC)
    world = driving(make_world, store=store, lost=lost)
    restart(world, path, away=lost + 4, settles=0.0)
    assert world.stands()
    where = world.truth.north
    check(world, "wait 10 : - it STANDS / queue RESTARTED")
    assert abs(world.truth.north - where) < 0.1


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
        seen.add((world.control(), world.mode()))
    assert not seen & {("IDLE", Mode.GUIDED), ("LEADING_IN", Mode.GUIDED)}


def test_a_server_that_stalls_while_zeros_stream_begins_that_again(make_world: MakeWorld) -> None:
    world = make_world(persona=PROMPT_PX4)
    world.client.move(2)
    world.until(lambda: world.control() == "LEADING_IN", within=5)
    check(world, "wait 0.3 & sleep 0.4 & until 1 EXECUTING within=8 : -")


def test_a_server_that_is_started_while_it_drives_home_sends_it_no_setpoint(
    make_world: MakeWorld, tmp_path: Path
) -> None:
    """Its failsafe is accepted as it is, and the server is killed while it drives."""
    path = tmp_path / "tasks.sqlite3"
    store = PromptSqliteStore(path, wall_offset=UTC)
    settings = Settings(loss_failsafe="accept")
    world = make_world(persona=PROMPT_PX4, store=store, settings=settings)
    world.rover.autopilot.parameters["COM_OBL_RC_ACT"] = 3
    world.client.move(60, speed=1.5)
    world.run(14)
    restart(world, path, away=2.5, settles=0.0)
    began = world.now
    world.run(5)
    assert world.mode() is Mode.RTL
    assert "zero" not in world.observer.sent_since(began)
    noted = [event.text for event in world.events(VehicleNoted)]
    assert noted[0].startswith("is in Return (failsafe or a person): mode not changed")
