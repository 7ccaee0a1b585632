"""Each refusal has a line in the journal and the log: who, what, why; of a flood only some."""

from pymavlink.dialects.v20 import common

from mav_tasks.settings import Roles, Settings
from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import setpoint
from tests.kit.mission import Download, Item, Upload, acks
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

WAYPOINT, START, SERVO = 16, 300, 183
CLEAR, SET_CURRENT, SET_MODE, SETPOINT = 45, 41, 11, 84  # message ids


def refusals(world: World) -> list[str]:
    return [str(event) for event in world.events(SubmissionRefused)]


def driven_plan(world: World) -> None:
    plan = [Item(WAYPOINT, **at(north, 0.0)) for north in (0.0, 4.0)]
    upload = Upload(world.client, plan)
    world.until(lambda: upload.result is not None, within=5)
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


def test_a_mission_that_is_paused_is_cleared_as_on_an_autopilot(world: World) -> None:
    driven_plan(world)
    world.client.pause()
    world.run(3)
    assert world.state(1) == (S.PAUSED, R.OPERATOR)
    world.client.send(common.MAVLink_mission_clear_all_message(1, 1, 0))
    world.run(2)
    assert acks(world.client)[-1].result == 0
    assert world.state(1)[0] is S.CANCELLED
    download = Download(world.client)
    world.until(lambda: download.is_done, within=3)
    assert (download.items, refusals(world)) == ([], [])


def test_a_stream_that_does_not_pass_has_one_line_in_half_a_minute(world: World) -> None:
    world.client.stream(setpoint(0.5), rate=20)
    world.run(20)
    assert len(refusals(world)) == 1
    assert f"message {SETPOINT} by 255/190" in refusals(world)[0]
    assert "setpoints dropped: set GUIDED first" in refusals(world)[0]
    world.run(12)
    assert len(refusals(world)) == 2


def test_what_nobody_can_verify_has_no_line_as_a_refusal_whoever_it_says_it_is_of(
    make_world: MakeWorld,
) -> None:
    world = make_world(settings=Settings(roles=Roles(unsigned="observer")))
    unknown = 0x0ABCDE
    for source in ((1, 1), (250, 191), (255, 190)):
        header = bytes((0xFD, 1, 0, 0, 0, *source)) + unknown.to_bytes(3, "little")
        world.client.send_raw(header + b"\x07\0\0")
    world.run(1)
    assert refusals(world) == []
