"""Each refusal has a line in the journal and the log: who, what, why; of a flood only some."""

from pymavlink.dialects.v20 import common

from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import setpoint
from tests.kit.mission import Item, acks
from tests.kit.world import World, at

WAYPOINT, START = 16, 300
CLEAR, SETPOINT = 45, 84  # message ids


def refusals(world: World) -> list[str]:
    return [str(event) for event in world.events(SubmissionRefused)]


def driven_plan(world: World) -> None:
    plan = [Item(WAYPOINT, **at(north, 0.0)) for north in (0.0, 4.0)]
    world.upload(plan)
    world.client.command(START, target=(1, 1))
    world.until_state(1, S.EXECUTING, within=10)
    world.run(1)


def test_clearing_a_mission_that_is_driven_is_refused_with_a_line(world: World) -> None:
    driven_plan(world)
    world.client.send(common.MAVLink_mission_clear_all_message(1, 1, 0))
    world.run(0.2)
    assert acks(world.client)[-1].result == 14  # DENIED
    (line,) = refusals(world)
    assert line.startswith(f"rover 1: message {CLEAR} by 255/190")
    assert line.endswith("clear: task 1 is being driven: pause or cancel it first")


def test_a_stream_that_does_not_pass_has_one_line_in_half_a_minute(world: World) -> None:
    world.client.stream(setpoint(0.5), rate=20)
    world.run(20)
    assert len(refusals(world)) == 1
    assert f"message {SETPOINT} by 255/190" in refusals(world)[0]
    assert "setpoints dropped: set GUIDED first" in refusals(world)[0]
    world.run(12)
    assert len(refusals(world)) == 2
