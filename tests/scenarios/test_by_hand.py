"""A person at the rover, or another client, against what tasks and their clients ask for."""

from math import inf, nan
from pathlib import Path

from pymavlink.dialects.v20 import common

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    GUIDED,
    setpoint,
)
from tests.kit.restarts import UTC, restart
from tests.kit.rows import ask, check
from tests.kit.store import PromptSqliteStore
from tests.kit.words import CANCEL, CLEAR
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld


def driving(world: World, distance: float = 20.0) -> World:
    world.client.move(distance)
    world.until_state(1, S.EXECUTING)
    world.run(2)
    return world


def taken_by_hand(world: World) -> None:
    world.operator_mode(Mode.MANUAL)
    world.rover.autopilot.operator_sticks(0.5, 0.2)


@for_each(
    "first, then", [("wait 0", "TASK_CANCEL 1"), ("wait 0", "TASK_CLEAR 1"), ("TASK_CANCEL 1", "")]
)
def test_what_is_cancelled_is_left_to_who_took_it_over(world: World, first: str, then: str) -> None:
    driving(world)
    ask(world, first)
    world.run(0.1)
    taken_by_hand(world)
    world.run(2)
    at = world.now
    if then:
        ask(world, then)
    check(world, f"wait 8 : {'ACCEPTED' if then else '-'} task 1: CANCELLED / mode manual")
    assert world.observer.sent_since(at) == []


@for_each("mode", [Mode.AUTO, Mode.RTL])
@for_each("how", [(CANCEL, 1), (CLEAR, 1)])
def test_it_is_left_to_them_by_the_next_server_too(
    make_world: MakeWorld, tmp_path: Path, mode: Mode, how: tuple[int, int]
) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = driving(make_world(store=PromptSqliteStore(path, wall_offset=UTC)))
    world.operator_mode(mode)
    world.run(2)
    world.client.command(*how)
    world.run(0.3)
    assert world.state(1)[0] is S.CANCELLED
    at = world.now
    restart(world, path, away=0.5)
    assert world.mode() is mode
    assert not {"zero", "HOLD"} & set(world.observer.sent_since(at))


def driven_by_a_client(world: World) -> World:
    world.client.mode(GUIDED)
    world.run(1.5)
    world.client.arm(True)
    world.run(1.5)
    world.client.stream(setpoint(1.0), rate=20)
    world.run(2)
    assert not world.stands()
    return world


def test_a_pause_stops_a_rover_that_a_client_drives(world: World) -> None:
    driven_by_a_client(world)
    world.client.end_streams()
    check(world, "other> PAUSE & wait 3 : ACCEPTED it STANDS", other=world.add_client("other"))


def test_a_disarm_is_not_undone_by_an_arming_that_waited(make_world: MakeWorld) -> None:
    world = make_world(conditions=Conditions(delay=0.04))
    world.operator_mode(Mode.HOLD)
    clients = [world.add_client(name) for name in "abc"]
    world.run(1.2)
    clients[0].arm(True)
    world.run(0.01)
    clients[1].arm(True)
    world.run(0.02)
    sent = clients[2].arm(False)
    world.run(2)
    assert (sent.result, world.is_armed) == (ACCEPTED, False)


def test_a_disarm_ends_a_clients_stream_at_once(make_world: MakeWorld) -> None:
    # which shows that it is disarmed once a second
    world = driven_by_a_client(make_world(persona=ARDUPILOT))
    at = world.now
    world.add_client("other").arm(False)
    world.run(0.1)
    late = world.now
    world.run(2)
    assert "zero" in world.observer.sent_since(at)
    assert "move" not in world.observer.sent_since(late)


@for_each("value", [nan, inf])
def test_a_position_that_is_none_is_passed_over(world: World, value: float) -> None:
    driving(world, 5.0)
    last = world.client.of_type("GLOBAL_POSITION_INT")[-1]
    later, rover = last.time_boot_ms + 60_000, common.MAVLink(None, 1, 1)
    messages = (
        common.MAVLink_global_position_int_message(later, last.lat, last.lon, *(0,) * 6),
        common.MAVLink_local_position_ned_message(later, value, value, 0, 0, 0, 0),
    )
    for message in messages:
        world.from_vehicle_side(message.pack(rover), peer="rover1")
        world.run(0.01)
    world.client.stop()
    world.run(3)
    assert world.stands()


def test_nobody_takes_the_position_away_from_a_task(world: World) -> None:
    driving(world)
    check(world, "SET_MESSAGE_INTERVAL 32 -1 to=1,50 & wait 3 : ACCEPTED task 1: EXECUTING")


def test_a_pause_that_the_rover_cannot_hear_says_so_and_counts(world: World) -> None:
    driving(world)
    silent = f"PAUSE & wait 1 : FAILED #{R.VEHICLE_SILENT} / queue OPERATOR"
    check(world, f"fault silent=1 deaf=1 & wait 4 : -\n{silent}")


def test_a_takeover_by_a_stations_sticks_names_the_station(world: World) -> None:
    world.client.move(20)
    world.run(0.1)
    world.client.send(common.MAVLink_manual_control_message(1, 1000, 0, 500, 0, 0))
    world.run(0.1)
    (pause,) = world.events(QueuePaused)
    assert pause.reason is R.TAKEOVER
    assert pause.actor.startswith("255/190@")
