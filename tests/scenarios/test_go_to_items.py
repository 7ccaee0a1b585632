"""A "go to" in the form of a mission item, as ground stations send it to an ArduPilot."""

from math import inf, nan
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED
from tests.kit.world import World, at, is_at

REPOSITION, CHANGE_MODE, GLOBAL = 192, 1, 0
OK, UNSUPPORTED, INVALID_X = 0, 3, 10  # MAV_MISSION_RESULT


def go_there(
    north: float, east: float, *, current: int = 2, command: int = 16, x: float | None = None
) -> Any:
    """MISSION_ITEM with float32 degrees."""
    place = at(north, east)
    latitude = place["x"] / 1e7 if x is None else x
    fields = (1, 1, 0, 3, command, current, 1, 0, 0, 0, nan, latitude, place["y"] / 1e7, 0)
    return common.MAVLink_mission_item_message(*fields)


def acks(world: World) -> list[tuple[int, int, int]]:
    """(result, mission type, task id) of each MISSION_ACK."""
    return [
        (ack.type, ack.mission_type, int.from_bytes(raw.payload[4:8], "little"))
        for ack, raw in zip(
            world.client.of_type("MISSION_ACK"),
            world.client.of_id(common.MAVLINK_MSG_ID_MISSION_ACK),
            strict=True,
        )
    ]


def test_beside_do_reposition_it_is_the_same_task(world: World) -> None:
    sent = world.client.command_int(
        REPOSITION, -1, CHANGE_MODE, 0, nan, **at(1.5, -1.0), frame=GLOBAL, target=(1, 1)
    )
    world.client.send(go_there(1.5, -1.0))  # in the same instant
    world.run(0.2)
    assert sent.answer == (ACCEPTED, 1)
    assert acks(world) == [(OK, 0, 1)]
    world.until_state(1, S.COMPLETED)
    assert is_at(world, 1.5, -1.0)
    assert len(world.tasks()) == 1


@for_each(
    "message, result, says",
    [
        (go_there(1, 1, command=20), UNSUPPORTED, "command 20 is not a place"),
        (go_there(1, 1, x=95.0), INVALID_X, "95.0"),
        (go_there(1, 1, x=inf), INVALID_X, "inf"),
        (go_there(1, 1, x=nan), INVALID_X, "not given"),
        (go_there(100_000.0, 0.0), INVALID_X - 5, "km away"),
    ],
)
def test_a_bad_one_is_refused_in_words(world: World, message: Any, result: int, says: str) -> None:
    world.client.send(message)
    world.run(0.2)
    assert acks(world) == [(result, 0, 0)]
    assert any(says in text for text in world.client.texts())
    assert not world.tasks()
    assert common.MAVLINK_MSG_ID_MISSION_ITEM not in [p.kind for p in world.observer.reached]
