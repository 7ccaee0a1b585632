"""Tasks are called off: promptly, visibly, and the rover stands before anything else begins."""

from math import nan

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Queueing, Settings
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Packer
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, DRIVE, MOVE, TEMPORARILY_REJECTED
from tests.kit.rows import check
from tests.kit.world import World, at
from tests.scenarios.conftest import MakeWorld

CANCEL, CLEAR = 54010, 54011


def driving(world: World) -> World:
    world.client.move(5, speed=1.0)
    world.until_state(1, S.EXECUTING)
    world.client.move(0.3)
    world.client.rotate(20)
    world.run(2)
    assert world.truth.forward_speed > 0.5
    return world


@for_each("task", [0, 1])
def test_the_running_task_is_cancelled_once_the_rover_stands(world: World, task: int) -> None:
    driving(world)
    check(
        world,
        f"""
TASK_CANCEL {task} : ACCEPTED #1 / task 1: CANCELLING CANCELLED / it gets zero
until 1 CANCELLED within=4 : - it STANDS / status 1: CANCELLED CANCELLED
idle 3 : - task 1: CANCELLED / task 2: COMPLETED / task 3: COMPLETED
""",
    )


@for_each("repeats_after", [0.5, 3.0])  # s; QGroundControl repeats after 3
def test_counted_copies_cancel_one_task_and_get_the_first_ones_answer(
    world: World, repeats_after: float
) -> None:
    driving(world)
    for confirmation in range(4):
        world.client.command(CANCEL, 0, confirmation=confirmation)
        world.run(repeats_after)
    assert world.client.acks_of(CANCEL) == [(ACCEPTED, 1)] * 4
    world.until_idle(tasks=3)
    assert world.states() == [S.CANCELLED, S.COMPLETED, S.COMPLETED]


def test_a_kill_is_zero_and_hold_at_once_and_no_latch(world: World) -> None:
    driving(world)
    at = world.now
    sent = world.client.command(CANCEL, 0, 1)
    world.run(0.05)
    assert sent.answer == (ACCEPTED, 1)
    assert world.state(1) == (S.KILLED, R.CANCELLED)
    assert {"zero", "HOLD"} <= set(world.observer.sent_since(at)[:3])
    world.until_state(2, S.STARTING, within=4)
    assert abs(world.truth.forward_speed) < 0.1
    world.until_idle(tasks=3)


def test_a_rover_that_does_not_stop_leaves_the_task_held_and_is_told_on(world: World) -> None:
    driving(world)  # without a position nobody can see it stand
    check(
        world,
        """
fault withheld=32,32 & TASK_CANCEL 1 : ACCEPTED
wait 5.1 : - task 1: HELD STOP_UNCONFIRMED
wait 0.5 : - task 2: QUEUED / it gets zero hold
fault & wait 5 : - it STANDS / mode hold
wait 0.6 : - task 1: HELD STOP_UNCONFIRMED
""",
    )


def test_waiting_tasks_are_cancelled_or_killed_at_once(world: World) -> None:
    driving(world)
    check(
        world,
        """
TASK_CANCEL 2 : ACCEPTED #2
wait 0.2 : -
TASK_CANCEL 3 1 : ACCEPTED task 2: CANCELLED CANCELLED / \
task 3: KILLED CANCELLED / task 1: EXECUTING
""",
    )


@for_each("scope, becomes", [(0, "COMPLETED"), (1, "CANCELLED")])
def test_clear_takes_what_waits_or_everything(world: World, scope: int, becomes: str) -> None:
    driving(world)
    check(
        world,
        f"""
TASK_CLEAR {scope} : ACCEPTED #0 / task 2: CANCELLED CLEARED / task 3: CANCELLED CLEARED
idle 3 : - task 1: {becomes}
""",
    )


def test_command_cancel_takes_the_askers_latest_of_that_command(world: World) -> None:
    other = world.add_client("other")
    other.send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    for client, distance in ((world.client, 1), (world.client, 2), (other, 3)):
        client.move(distance)
        world.run(0.1)
    world.client.rotate(10)
    world.run(0.1)
    acks = len(world.client.acks)
    for command in (DRIVE, MOVE):  # no DRIVE waits, so nothing is cancelled for the first one
        message = m.CommandCancel(1, 191, command)
        world.client.send_raw(Packer().pack(message, Address(255, 190), seq=200))
    world.run(0.3)
    assert world.state(2) == (S.CANCELLED, R.CANCELLED)
    assert [world.state(i)[0] for i in (3, 4)] == [S.QUEUED, S.QUEUED]
    assert len(world.client.acks) == acks


def test_a_client_has_a_quota_and_a_rover_a_capacity(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(queueing=Queueing(capacity=4, quota=3)))
    other = world.add_client("other", system_id=1 + 244)
    other.send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))
    world.client.pause()
    world.run(0.1)
    mine = []
    for distance in (1, 2, 3, 4):
        mine.append(world.client.move(distance))
        world.run(0.05)
    theirs = []
    for distance in (1, 2):
        theirs.append(other.move(distance))
        world.run(0.05)
    assert mine[3].answer == (TEMPORARILY_REJECTED, R.QUOTA)
    assert theirs[1].answer == (TEMPORARILY_REJECTED, R.QUEUE_FULL)
    assert theirs[0].task_id == 4


@for_each("word", [CANCEL, CLEAR])
@for_each("whose", ["a person's", "another client's"])
def test_who_only_cancels_may_not_end_anothers_halt_by_a_click(
    world: World, word: int, whose: str
) -> None:
    other = world.add_client("other", system_id=200)
    driving(world)
    if whose == "a person's":
        world.operator_mode(Mode.HOLD)
    else:
        other.pause()
    world.run(3)
    world.client.command(word, 1)
    world.run(1)
    click = world.client.command_int(192, -1, 1, 0, nan, **at(-3.0, 0.0), frame=6, target=(1, 1))
    world.run(3)
    assert world.state(click.task_id)[0] is S.QUEUED
    assert world.stands()
    other.proceed()
    world.until_state(click.task_id, S.EXECUTING)
