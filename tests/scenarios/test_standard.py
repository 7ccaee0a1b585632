"""The commands that stock clients send without knowing of tasks become tasks all the same."""

from math import nan

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, RTL, set_mode
from tests.kit.world import World, at, is_at, near_pose, put_home
from tests.scenarios.conftest import MakeWorld

WAYPOINT, RETURN = 16, 20
YAW, SPEED, REPOSITION = 115, 178, 192
GLOBAL, LOCAL, GLOBAL_RELATIVE_INT = 0, 1, 6


@for_each("target", [(1, 1), (1, 191), (1, 0)])
@for_each("frame", [GLOBAL, 5, GLOBAL_RELATIVE_INT])
def test_go_to_drives_to_the_place(world: World, target: tuple[int, int], frame: int) -> None:
    sent = world.client.command_int(
        REPOSITION, -1, 1, 0, nan, **at(1.5, -2.0), frame=frame, target=target
    )
    world.run(0.2)
    assert sent.answer == (ACCEPTED, 1)
    world.until_idle(tasks=1)
    assert world.state(1)[0] is S.COMPLETED
    assert is_at(world, 1.5, -2.0)


def test_go_to_in_the_local_frame_and_then_a_heading(world: World) -> None:
    world.client.command_int(WAYPOINT, 1.0, 0, 0, -90, x=-12_000, y=10_000, frame=LOCAL)
    world.until_idle(tasks=1)
    assert near_pose(world.pose(), (-1.2, 1.0, -90.0))


def test_go_to_now_runs_at_once_and_the_other_goes_on_when_continued(
    make_world: MakeWorld,
) -> None:
    world = make_world(settings=Settings(guided="now"))
    world.client.move(3)
    world.run(3)
    world.client.move(0.3)
    world.run(0.1)
    for place in (at(0.5, 1.0), at(0.5, -1.0)):  # the operator thinks better of the first
        world.client.command_int(REPOSITION, -1, 1, 0, nan, **place, frame=GLOBAL, target=(1, 1))
        world.run(2)
    world.until_state(4, S.COMPLETED)
    world.run(1)
    assert [world.state(i) for i in (1, 3)] == [(S.PAUSED, R.OPERATOR), (S.CANCELLED, R.REPLACED)]
    assert world.paused() is R.OPERATOR
    assert is_at(world, 0.5, -1.0)
    world.client.proceed()
    world.until_idle(tasks=4)
    assert near_pose(world.pose(), (3.3, 0.0, 0.0))


@for_each("how", ["command", "mode", "old mode message"])
def test_return_drives_home(world: World, how: str) -> None:
    put_home(world, 0.0, 0.0)
    world.client.move(1.0)
    world.until_idle(tasks=1)
    if how == "command":
        world.client.command(RETURN, target=(1, 1))
    elif how == "mode":
        world.client.mode(RTL)
    else:
        world.client.send(set_mode(RTL))
    world.run(0.2)
    world.until_idle(tasks=2)
    assert world.mode() is Mode.HOLD
    assert is_at(world, 0.0, 0.0)
    assert world.paused() is R.NONE, "nothing waits"


@for_each(
    "params, yaw",
    [((90, 20, 0, 0), 90.0), ((90, 0, -1, 0), 90.0), ((30, 0, 1, 1), 30.0), ((30, 0, -1, 1), -30)],
)
def test_a_heading_is_turned_to(
    world: World, params: tuple[float, float, float, float], yaw: float
) -> None:
    world.client.command(YAW, *params, target=(1, 1))
    world.until_idle(tasks=1)
    assert near_pose(world.pose(), (0.0, 0.0, yaw))


def test_the_speed_is_changed_of_what_runs_and_of_what_comes(world: World) -> None:
    world.client.move(3, speed=0.3)
    world.run(3)
    sent = world.client.command(SPEED, 1, 0.8, -1, target=(1, 1))
    world.run(2)
    assert sent.answer == (ACCEPTED, 1)
    assert world.truth.forward_speed == pytest.approx(0.8, abs=0.08)
    world.until_idle(tasks=1)
    world.client.move(4)
    world.run(4)
    assert world.truth.forward_speed == pytest.approx(0.8, abs=0.08)
    world.until_idle(tasks=2)
    world.client.command(SPEED, 1, -2, -1)
    world.client.move(1.5)
    world.run(2.5)
    assert world.truth.forward_speed == pytest.approx(0.5, abs=0.05)


def test_another_origin_holds_what_runs(world: World) -> None:
    world.client.move(3)
    world.run(3)
    moved = common.MAVLink_gps_global_origin_message(-353_600_000, 1_491_600_000, 0)
    raw = moved.pack(common.MAVLink(None, 1, 1))
    world.from_vehicle_side(raw, peer="rover1")
    world.run(0.2)
    assert world.state(1) == (S.HELD, R.FRAME_RESET)
    world.until(world.stands, within=3)
