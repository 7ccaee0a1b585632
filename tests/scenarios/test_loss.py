"""What is lost on the way, or stops making sense: the rover stops, and nothing is guessed."""

from math import inf

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.shell.in_memory import VEHICLE_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.rows import check
from tests.kit.world import Outputs, World, near_pose
from tests.scenarios.conftest import MakeWorld

HEARTBEAT, ATTITUDE, POSITION = 0, 30, 32
SETPOINT, COMMAND = 84, 76
ARM_DISARM, SET_MODE = common.MAV_CMD_COMPONENT_ARM_DISARM, common.MAV_CMD_DO_SET_MODE


LOSSES = {
    "heartbeats": (Faults(withheld=frozenset({HEARTBEAT})), R.LINK_LOST, 4.0),
    "everything": (Faults(silent=True), R.POSITION_LOST, 1.5),
    "position": (Faults(withheld=frozenset({POSITION})), R.POSITION_LOST, 1.5),
    "attitude": (Faults(withheld=frozenset({ATTITUDE})), R.POSITION_LOST, 1.5),
    "all but heartbeats": (Faults(withheld=frozenset(range(1, 512))), R.POSITION_LOST, 1.5),
    "numbers": (Faults(not_finite=True), R.POSITION_LOST, 1.5),
    "the rover's clock": (Faults(clock_frozen=True), R.POSITION_LOST, 1.5),
    "frozen position": (Faults(position_frozen=True), R.POSITION_LOST, 1.5),
}


@for_each("what", LOSSES)
def test_the_rover_stops_and_resumes_by_itself_after_2_s_of_good_data(
    driving: World, what: str
) -> None:
    world = driving
    faults, reason, within = LOSSES[what]
    world.fault(faults)
    world.until_state(1, S.PAUSED, within=within)
    assert world.state(1) == (S.PAUSED, reason)
    world.until(world.stands, within=2)
    world.run(4)
    where = world.pose()
    assert world.state(1) == (S.PAUSED, reason)

    world.fault(Faults())
    back = world.now
    world.until(lambda: world.state(1)[0] is not S.PAUSED, within=4)
    assert 1.9 < world.now - back < 3.5
    assert world.pose() == where
    world.until_idle(tasks=2)
    assert world.states() == [S.COMPLETED] * 2
    assert near_pose(world.pose(), (4.0, 0.0, 90.0))


@for_each("what", ["heartbeats", "all but heartbeats", "frozen position"])
def test_after_30_s_it_fails_and_the_queue_pauses(driving: World, what: str) -> None:
    world = driving
    faults, _, within = LOSSES[what]
    world.fault(faults)
    world.run(30 + within + 3)
    assert world.state(1) == (S.FAILED, R.LINK_TIMEOUT)
    assert (world.paused(), world.state(2)[0]) == (R.LINK_TIMEOUT, S.QUEUED)
    world.fault(Faults())
    world.run(5)
    assert world.stands()
    assert world.rover.autopilot.mode is Mode.HOLD
    assert world.control() == "IDLE"


def test_no_motion_on_data_older_than_0_3_s(driving: World) -> None:
    world = driving
    at = world.now
    world.fault(Faults(withheld=frozenset({POSITION})))
    world.run(0.9)
    assert "move" in world.observer.sent_since(at)
    assert "move" not in world.observer.sent_since(at + 0.3)
    assert world.state(1)[0] is S.EXECUTING
    world.fault(Faults())
    world.until_idle(tasks=2)
    assert near_pose(world.pose(), (4.0, 0.0, 90.0))


def test_a_lost_task_does_not_resume_while_paused_by_an_operator(driving: World) -> None:
    check(
        driving,
        """
fault withheld=32,32 & until 1 PAUSED within=2 : -
PAUSE & wait 1 : ACCEPTED
fault & wait 6 : - task 1: PAUSED / queue OPERATOR
CONTINUE & idle 2 : ACCEPTED
""",
    )


def test_a_lost_task_does_not_resume_on_a_disarmed_rover(driving: World) -> None:
    check(
        driving,
        """
fault silent=1 & until 1 PAUSED within=2 : -
operator disarms & wait 4 : -
fault & wait 8 : - task 1: PAUSED / it is DISARMED
""",
    )


@for_each("jump", ["2.5,0", "0,-30", "50,0"])
def test_a_jump_of_the_position_holds_the_task(driving: World, jump: str) -> None:
    check(
        driving,
        f"""
fault position_jump={jump} & wait 1 : - task 1: HELD FRAME_RESET
wait 2 : - it STANDS
wait 10 : - task 2: QUEUED
TASK_STOP & wait 1 : ACCEPTED task 1: KILLED STOP
""",
    )


def test_a_reboot_that_only_the_rovers_clock_tells_of_holds_the_task_too(driving: World) -> None:
    world = driving
    check(world, "PAUSE & wait 4 : ACCEPTED\nlose 0 & reboot & wait 1.5 : -")
    check(world, "operator hold & wait 0.1 : -")  # as it was before
    world.watched.loses = lambda *_: False
    check(world, "wait 3 : - task 1: HELD FRAME_RESET")


@for_each("late", [0.55, 1.0, 2.5])
def test_a_late_tick_is_a_zero_first_and_holds_the_task(driving: World, late: float) -> None:
    world = driving
    world.observer.expects_gaps = True
    world.suspend_server(late)
    at = world.now
    check(world, "wait 0.1 : - task 1: HELD LATE / it gets zero / !move")
    assert len(world.observer.sent_since(at)) < 8
    check(world, "wait 5 : - it STANDS / mode hold")


def test_what_moves_a_rover_must_not_leave_late_and_what_stops_it_may(
    make_world: MakeWorld,
) -> None:
    outputs = Outputs()
    world = make_world(outputs=outputs)
    world.client.move(1)
    world.until_state(1, S.EXECUTING)
    world.run(1)
    world.client.stop()
    world.run(3)
    left = [
        (common.MAVLink(None).decode(bytearray(packet.data)), packet.until - at)
        for at, packet in outputs.sent
        if packet.link == VEHICLE_LINK
    ]
    late = Settings().watch.motion_fresh
    moving = [until for each, until in left if each.get_msgId() == SETPOINT and each.vx]
    zeros = [until for each, until in left if each.get_msgId() == SETPOINT and not each.vx]
    commands = [each for each in left if each[0].get_msgId() == COMMAND]
    arming = [until for each, until in commands if each.command == ARM_DISARM and each.param1 == 1]
    others = [until for each, until in commands if each.command == SET_MODE]
    assert len(moving) > 10
    assert arming
    assert [*moving, *arming] == pytest.approx([late] * len([*moving, *arming]))
    assert len(zeros) > 10
    assert len(others) > 1  # ours, and HOLD
    assert set(zeros + others) == {inf}


def test_what_came_while_the_server_stood_still_is_not_taken_for_fresh(driving: World) -> None:
    driving.observer.expects_gaps = True
    check(driving, "sleep 0.1 & fault withheld=32,32 & sleep 0.35 & wait 0 : -")
    check(driving, "wait 0.2 : - task 1: EXECUTING / it gets zero.")
