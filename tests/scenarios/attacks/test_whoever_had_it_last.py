"""Who drives by hand, or set HOLD, is obeyed until somebody who may lets the tasks go on.

D7: a "go to" of another program behind the same router undid an operator's HOLD. D10: a person who
parked a rover by HOLD, after driving it by hand, had it drive off with what waited.
"""

from math import nan

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Roles, Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.px4 import HOLD, PROMPT_PX4, REPOSITION, ask_mode
from tests.kit.rows import check
from tests.kit.world import World, at
from tests.scenarios.attacks.test_left_waiting import stays, unheard
from tests.scenarios.conftest import MakeWorld

CHANGE_MODE = 1  # of DO_REPOSITION


def drive_by_hand(world: World) -> None:
    """Let a person at the rover arm it and drive it by hand for a while."""
    world.operator_mode(Mode.MANUAL)
    world.operator_arm(True)
    world.run(20)


@for_each("when", ["before", "meanwhile"])
def test_a_rover_that_a_person_parks_does_not_drive_off_with_what_waits(
    world: World, when: str
) -> None:
    if when == "before":  # begins in 15 s
        check(world, "TASK_MOVE 3 0 0 0 0 15 5 : ACCEPTED")
    drive_by_hand(world)
    if when == "meanwhile":
        check(world, "TASK_MOVE 3 : ACCEPTED")
    check(world, "wait 2 & operator hold & wait 0 : -")
    before = world.pose()
    check(world, "wait 20 : - queue TAKEOVER / task 1: QUEUED")
    assert world.pose() == pytest.approx(before, abs=0.001)
    check(world, "CONTINUE & until 1 COMPLETED : ACCEPTED")


def test_a_go_to_of_another_behind_the_same_router_does_not_undo_a_hold(
    make_world: MakeWorld,
) -> None:
    roles = Roles(addresses={"245/190": "submitter"})
    world = make_world(persona=PROMPT_PX4, settings=Settings(roles=roles))
    world.client.move(20, speed=0.5)
    world.until_faster(0.45)
    ask_mode(world.client, HOLD)
    world.run(0.3)
    router_packs_as_another = common.MAVLink(None, 245, 190)
    go_to = common.MAVLink_command_int_message(
        1, 1, 6, REPOSITION, 0, 0, -1, CHANGE_MODE, 0, nan, *at(5.0, 0.0).values(), 0
    )
    world.client.send_raw(go_to.pack(router_packs_as_another))
    world.run(6)
    before = world.pose()
    world.run(5)
    assert world.pose() == pytest.approx(before, abs=0.01)
    assert world.paused() is R.OPERATOR
    assert [task.goal for task in world.tasks()][1:], "the goal itself is queued"


@for_each("way", ["put back", "turned round"])
def test_a_rover_that_was_taken_and_parked_unheard_does_not_go_on_by_itself(
    world: World, way: str
) -> None:
    """It is near its line and in HOLD, as one is that only its link was away."""
    world.client.move(10, speed=0.5)
    world.until(lambda: world.truth.north > 3, within=40)
    unheard(world)
    world.run(8)  # the server asks for HOLD, of which it hears nothing
    world.operator_mode(Mode.MANUAL)
    throttle, steering = (-0.5, 0.0) if way == "put back" else (0.0, 0.5)
    for _ in range(3):
        world.operator_mode(Mode.MANUAL)
        world.rover.autopilot.operator_sticks(throttle, steering)
        world.run(1)
    world.rover.autopilot.operator_sticks(0.0, 0.0)
    world.run(1)
    world.operator_mode(Mode.HOLD)
    world.watched.loses = lambda *_: False
    assert stays(world, 10)
    assert world.state(1)[0] is S.HELD
