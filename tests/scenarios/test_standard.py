"""The commands that stock clients send without knowing of tasks become tasks all the same."""

import pytest

from mav_tasks.config.settings import Settings
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED
from tests.kit.rows import check
from tests.kit.world import World, is_at, put_home
from tests.scenarios.conftest import MakeWorld

SPEED = 178


@for_each("target", ["autopilot", "server", "rover"])
@for_each("frame", [0, 5, 6])
def test_go_to_drives_to_the_place(world: World, target: str, frame: int) -> None:
    check(
        world,
        f"""
DO_REPOSITION -1 1 0 nan at=1.5,-2 frame={frame} to={target} : ACCEPTED #1
idle 1 : - task 1: COMPLETED
""",
    )
    assert is_at(world, 1.5, -2.0)


def test_go_to_in_the_local_frame_and_then_a_heading(world: World) -> None:
    check(
        world, "NAV_WAYPOINT 1 0 0 -90 x=-12000 y=10000 frame=1 & idle 1 : ACCEPTED at=-1.2,1,-90"
    )


def test_go_to_now_runs_at_once_and_the_other_goes_on_when_continued(
    make_world: MakeWorld,
) -> None:
    world = make_world(settings=Settings(guided="now"))  # the operator thinks better of a click
    check(
        world,
        """
TASK_MOVE 3 & wait 3 : ACCEPTED
TASK_MOVE 0.3 : ACCEPTED
DO_REPOSITION -1 1 0 nan at=0.5,1 frame=0 to=autopilot & wait 2 : ACCEPTED
DO_REPOSITION -1 1 0 nan at=0.5,-1 frame=0 to=autopilot & until 4 COMPLETED : ACCEPTED
wait 1 : - task 1: PAUSED OPERATOR / task 3: CANCELLED REPLACED / queue OPERATOR
""",
    )
    assert is_at(world, 0.5, -1.0)
    check(world, "CONTINUE & idle 4 : ACCEPTED at=3.3,0,0")


RETURNS = """NAV_RETURN_TO_LAUNCH to=autopilot : ACCEPTED
DO_SET_MODE 1 11 to=autopilot : ACCEPTED
client:set_mode 1 1 11 : -"""


@for_each("asked", RETURNS.splitlines())
def test_return_drives_home(world: World, asked: str) -> None:
    put_home(world, 0.0, 0.0)
    check(world, f"TASK_MOVE 1 & idle 1 : ACCEPTED\n{asked}\nidle 2 : - mode hold / queue NONE")
    assert is_at(world, 0.0, 0.0)


@for_each(
    "asked, yaw", [("90 20 0 0", 90), ("90 0 -1 0", 90), ("30 0 1 1", 30), ("30 0 -1 1", -30)]
)
def test_a_heading_is_turned_to(world: World, asked: str, yaw: int) -> None:
    check(world, f"CONDITION_YAW {asked} to=autopilot & idle 1 : ACCEPTED at=0,0,{yaw}")


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
    check(
        world,
        """
TASK_MOVE 3 & wait 3 : ACCEPTED
rover:gps_global_origin -353600000 1491600000 0 & wait 0.2 : - task 1: HELD FRAME_RESET
wait 3 : - it STANDS
""",
    )
