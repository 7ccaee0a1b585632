"""The server's settings as parameters of its component, and the rover's own beside them."""

from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.parameter_table import PARAMETERS
from mav_tasks.config.settings import Settings
from mav_tasks.engine.engine import Engine
from mav_tasks.engine.inputs import ParametersChanged
from mav_tasks.tasks.events import ParameterSet
from mav_tasks.tasks.restored import Restored
from tests.kit.cases import for_each
from tests.kit.client import FakeClient
from tests.kit.restarts import UTC, restart
from tests.kit.rows import check
from tests.kit.store import LateStore, PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

ROVER, SERVER = (1, 1), (1, 191)
REAL32, INT32 = 9, 6
OPEN_FILE = 4  # opcode of FILE_TRANSFER_PROTOCOL
NOT_ALLOWED = 3  # MAV_PARAM_ERROR


def ask_all(component: int, *, system: int = 1) -> Any:
    return common.MAVLink_param_request_list_message(system, component)


def ask(component: int, name: str = "", index: int = -1) -> Any:
    return common.MAVLink_param_request_read_message(1, component, name.encode(), index)


def put(name: str, value: float, *, component: int = 191, type_: int = REAL32) -> Any:
    return common.MAVLink_param_set_message(1, component, name.encode(), value, type_)


def open_file(client: FakeClient, path: bytes) -> None:
    payload = [0, 0, 0, OPEN_FILE, len(path), *[0] * 7, *path]
    payload += [0] * (251 - len(payload))
    client.send(common.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))


def told(client: FakeClient, source: tuple[int, int] = SERVER) -> list[tuple[str, float]]:
    """(name, value) of each PARAM_VALUE from a source, in order."""
    found = [client.decoded(p) for p in client.of_id(22) if p.source == source]
    return [(each.param_id, round(each.param_value, 6)) for each in found]


def errors(client: FakeClient) -> list[tuple[str, int]]:
    """(name, error) of each PARAM_ERROR."""
    return [(each.param_id, each.error) for each in client.of_type("PARAM_ERROR")]


@for_each("component, ours, the_rovers", [(0, True, True), (1, False, True), (191, True, False)])
def test_a_list_is_of_who_is_asked(
    world: World, component: int, ours: bool, the_rovers: bool
) -> None:
    world.run(2)  # the server has asked the rover for its speed
    world.client.received.clear()
    world.client.send(ask_all(component))
    world.run(0.5)
    assert bool(told(world.client)) is ours
    assert bool(told(world.client, ROVER)) is the_rovers
    if ours:
        values = [world.client.decoded(p) for p in world.client.of_id(22) if p.source == SERVER]
        assert [each.param_id for each in values] == list(PARAMETERS)
        assert [each.param_index for each in values] == list(range(len(PARAMETERS)))
        assert {each.param_count for each in values} == {len(PARAMETERS)}
        assert {each.param_type for each in values} == {REAL32}
        assert ("TSK_SPEED", 0.5) in told(world.client)


def test_lists_are_not_sent_faster_than_anybody_reads_them(world: World) -> None:
    """One packet asks for nineteen, and setpoints leave by the same loop."""
    for _ in range(200):
        world.client.send(ask_all(191))
        world.run(0.002)
    assert len(PARAMETERS) <= len(told(world.client)) <= 3 * len(PARAMETERS)
    world.run(0.2)
    before = len(told(world.client))
    world.client.send(ask_all(191))
    world.run(0.1)
    assert len(told(world.client)) - before == len(PARAMETERS)


def test_one_is_read_and_set_by_name_and_read_by_number(world: World) -> None:
    check(
        world,
        """
param_request_read to=server TSK_SPEED_MAX -1 : - TSK_SPEED_MAX=2
param_request_read to=server _ 0 : - TSK_SPEED=0.5
param_request_read to=rover TSK_QUOTA -1 : - TSK_QUOTA=500
param_request_read to=server TSK_NONE -1 : - TSK_NONE: error 1
param_request_read to=server _ 99 : - : error 1
param_set to=server TSK_NONE 1 9 : - TSK_NONE: error 1 / TSK_NONE: no such parameter
""",
    )
    assert told(world.client) == [("TSK_SPEED_MAX", 2.0), ("TSK_SPEED", 0.5), ("TSK_QUOTA", 500.0)]


def test_who_reads_the_rovers_from_a_file_gets_the_list(make_world: MakeWorld) -> None:
    """QGroundControl 4.4 asks an ArduPilot for a file, and then for no list."""
    world = make_world()
    open_file(world.client, b"@PARAM/param.pck?withdefaults=1")
    world.run(0.1)
    assert len(told(world.client)) == len(PARAMETERS)
    world.client.send(ask_all(0))  # there is no such file, as on the simulated rover
    world.run(0.1)
    assert len(told(world.client)) == 2 * len(PARAMETERS)


def test_a_change_has_effect_and_everybody_is_told(world: World) -> None:
    other = world.add_client("other")
    other.send(ask(191, "TSK_SPEED"))
    world.client.send(put("TSK_SPEED", 0.8))
    world.run(0.2)
    assert told(world.client) == [("TSK_SPEED", 0.8)]
    assert told(other)[-1] == ("TSK_SPEED", 0.8)
    world.client.move(3)
    world.until_faster(0.75)
    world.until_idle(tasks=1)


def test_a_bad_value_changes_nothing_and_is_named(world: World) -> None:
    table = """
param_set to=server TSK_SPEED 50 9 : - SAME / TSK_SPEED 50: not in 0.05..10
param_set to=server TSK_SPEED nan 9 : - SAME / TSK_SPEED nan: not in 0.05..10
param_set to=server TSK_SPEED 3 9 : - SAME / TSK_SPEED 3 is more than TSK_SPEED_MAX 2
param_set to=server TSK_SPEED 1 6 : - SAME / TSK_SPEED must be sent as REAL32
"""
    check(world, table.replace("SAME", "TSK_SPEED: error 2 / TSK_SPEED=0.5"))
    assert told(world.client) == [("TSK_SPEED", 0.5)] * 4
    assert world.events(ParameterSet) == []


def test_a_restart_keeps_what_was_set(make_world: MakeWorld, tmp_path: Path) -> None:
    path = tmp_path / "tasks.sqlite3"
    world = make_world(store=PromptSqliteStore(path, wall_offset=UTC))
    world.client.send(put("TSK_SPEED_MAX", 4.0))
    world.client.send(put("TSK_SPEED", 3.0))
    world.run(0.5)
    restart(world, path, well=True, away=0.0)
    world.client.received.clear()
    world.client.send(ask(191, "TSK_SPEED"))
    world.run(0.2)
    assert told(world.client) == [("TSK_SPEED", 3.0)]


def test_what_was_kept_and_is_out_of_range_now_is_named() -> None:
    restored = Restored(parameters={"TSK_SPEED": 0.4, "TSK_SPEED_MAX": 50.0})
    engine = Engine(Settings(), now=0.0, restored=restored)
    assert engine.not_in_force == ("TSK_SPEED_MAX 50: not in 0.05..10",)


def test_what_is_not_stored_in_time_is_not_set(make_world: MakeWorld) -> None:
    store = LateStore()
    world = make_world(store=store)
    store.delay = 5.0
    world.client.send(put("TSK_SPEED", 0.8))
    world.run(0.6)
    assert told(world.client) == [("TSK_SPEED", 0.5)]
    assert errors(world.client) == [("TSK_SPEED", NOT_ALLOWED)]
    assert [event.value for event in world.events(ParameterSet)] == [0.8, None]


def test_the_rovers_own_parameters_are_the_rovers(world: World) -> None:
    world.run(2)  # the server has asked the rover for its speed
    world.client.received.clear()
    world.client.send(put("WP_SPEED", 3.0, component=1))
    world.client.send(ask(1, "SYSID_THISMAV"))
    world.client.send(ask(1, "TSK_SPEED"))
    world.run(0.3)
    assert dict(told(world.client, ROVER)) == {"WP_SPEED": 3.0, "SYSID_THISMAV": 1.0}
    assert told(world.client) == []
    assert world.rover.autopilot.parameters["WP_SPEED"] == 3.0


def test_a_parameter_that_was_set_at_another_gateway_is_in_force_and_told(
    make_world: MakeWorld,
) -> None:
    world = make_world(store=LateStore(delay=0.3))
    world.server.take_in(ParametersChanged((("TSK_SPEED", 0.3),)), now=world.now)
    world.run(0.5)
    assert told(world.client) == [("TSK_SPEED", 0.3)]
    assert world.server.engine.parameters == {"TSK_SPEED": 0.3}
    assert world.events(ParameterSet) == []
    world.client.send(put("TSK_SPEED", 0.4))
    world.run(0.1)
    # what was read meanwhile is older than what is being stored here
    world.server.take_in(ParametersChanged((("TSK_SPEED", 0.2),)), now=world.now)
    world.run(1.0)
    assert world.server.engine.parameters == {"TSK_SPEED": pytest.approx(0.4)}
    world.server.take_in(ParametersChanged(()), now=world.now)
    world.run(0.5)
    assert told(world.client)[-1] == ("TSK_SPEED", 0.5)
