"""STOP: whatever the rover does, it stands soon, and nothing moves it until continue."""

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    FAILED,
    GUIDED,
    REPEATS,
)
from tests.kit.rows import ask, check
from tests.kit.store import LateStore
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld

BRAKING = 3.5  # s, from the speeds driven here to a stand


def drive(world: World) -> None:
    """Have a task drive, and another one wait."""
    first = world.client.move(20, speed=1.0)
    world.until_state(1, S.EXECUTING)
    world.client.rotate(30)
    world.run(2.0)
    assert first.task_id == 1
    assert world.truth.forward_speed > 0.5


def drive_by_itself(world: World, mode: Mode) -> None:
    """Have the operator send the rover somewhere; a task waits."""
    world.rover.autopilot.parameters["WP_SPEED"] = 1.0
    world.operator_arm(True)
    world.operator_mode(Mode.AUTO)
    world.run(0.5)
    world.client.move(1)
    world.run(2.5)
    world.operator_mode(mode)
    world.run(1.0)
    assert not world.stands()


def stands_in_hold(world: World) -> bool:
    return world.stands() and world.mode() is Mode.HOLD and world.control() == "IDLE"


@for_each("component", [0, 1, 191, 154])
def test_a_driving_rover_is_stopped_and_its_task_killed(world: World, component: int) -> None:
    drive(world)
    figures = world.server.engine.figures
    assert not figures.is_still(1, now=world.now)
    stop = world.client.stop(target=(1, component))
    world.until(lambda: stop.ack, within=0.1)
    world.until(lambda: stands_in_hold(world), within=BRAKING)
    shown = figures.of(1, now=world.now)
    assert shown is not None
    assert shown.position_age < 0.3

    assert stop.answer == (ACCEPTED, 1)
    assert world.history(1)[-1] == (S.KILLED, R.STOP)
    assert world.state(2) == (S.QUEUED, R.NONE)
    assert world.paused() is R.STOPPED
    where = world.pose()
    world.run(10)
    assert near_pose(world.pose(), where, metres=0.03)
    assert world.state(2)[0] is S.QUEUED


@for_each("mode", [Mode.AUTO, Mode.RTL])
def test_a_rover_that_drives_by_itself_is_stopped(world: World, mode: Mode) -> None:
    drive_by_itself(world, mode)
    check(
        world,
        "TASK_STOP : ACCEPTED #0\nwait 2.7 : - it STANDS / mode hold / it is IDLE / task 1: QUEUED",
    )


def test_with_param1_the_queue_is_cleared(world: World) -> None:
    drive(world)
    check(
        world, "TASK_STOP 1 & wait 3.1 : ACCEPTED task 2: CANCELLED CLEARED / it STANDS / mode hold"
    )
    check(world, "CONTINUE & wait 1.6 : ACCEPTED queue NONE / it is IDLE")


def test_stop_with_an_empty_queue_and_twice(world: World) -> None:
    check(
        world,
        """
TASK_STOP & TASK_STOP : ACCEPTED+ACCEPTED #0 / it STANDS / mode hold / it is IDLE
TASK_MOVE 1 & wait 2.6 : ACCEPTED #1 / task 1: QUEUED NONE
TASK_STOP & wait 2.6 : ACCEPTED #0
CONTINUE & until 1 COMPLETED : ACCEPTED
""",
    )


@for_each("delay", [k * 0.002 for k in range(0, 12, 3)])
def test_stop_while_starting(world: World, delay: float) -> None:
    """From before the mode is asked for until the first motion, in steps of 2 ms."""
    world.client.move(5)
    world.run(delay)
    world.client.stop()
    world.until(lambda: stands_in_hold(world), within=3)
    world.run(3)
    assert world.state(1)[0] in (S.KILLED, S.QUEUED)
    assert (world.truth.north, world.paused()) == (0.0, R.STOPPED)


@for_each("phase", ["ASKING_MODE", "ASKING_ARM"])
def test_stop_while_the_rover_does_not_answer_our_requests(world: World, phase: str) -> None:
    world.client.move(5)
    while world.control() != phase:
        world.run(0.005)  # less than an answer takes
    world.fault(Faults(deaf=True))
    world.run(0.1)
    assert world.control() == phase
    world.client.stop()
    world.run(0.3)
    world.fault(Faults())
    world.until(lambda: stands_in_hold(world), within=2)
    assert world.history(1) == [(S.STARTING, R.NONE), (S.KILLED, R.STOP)]
    assert world.truth.north == 0.0


MOTION_OF_CLIENTS = """client:set_position_target_local_ned 0 1 1 8 1479 0 0 0 1 0 0 0 0 0 0 0
client:set_attitude_target 0 1 1 0 1,0,0,0 0 0 0 0.5
client:manual_control 1 1000 0 1000 0 0
client:rc_channels_override 1 1 1500 1500 2000 0 0 0 0 0
client:set_mode 1 1 15
client:set_mode 1 1 10
client:set_mode 1 1 0"""


@for_each("message", MOTION_OF_CLIENTS.splitlines())
def test_no_motion_message_passes_while_stopped(world: World, message: str) -> None:
    world.operator_arm(True)
    world.client.mode(GUIDED)
    world.run(1)
    world.client.stop()
    world.run(1)
    for _ in range(20):
        ask(world, message)
        world.run(0.1)
    assert stands_in_hold(world)


def test_no_command_that_moves_passes_while_stopped(world: World) -> None:
    world.client.stop()
    world.run(1)
    check(
        world,
        """
ARM 1 : BUSY
COMPONENT_ARM_DISARM 1 to=rover : BUSY
COMPONENT_ARM_DISARM 1 to=unknown : BUSY
COMPONENT_ARM_DISARM 1 to=autopilot frame=1 : BUSY
DO_SET_MODE 1 15 to=autopilot : BUSY
DO_SET_MODE 1 10 to=unknown : BUSY
MISSION_START to=unknown : BUSY
DO_MOTOR_TEST 1 0 50 10 to=autopilot : BUSY
""",
    )
    assert (world.mode(), world.is_armed) == (Mode.HOLD, False)


def test_hold_by_a_client_does_not_end_a_stop_that_is_under_way(world: World) -> None:
    drive(world)
    check(
        world,
        """
fault refuse_mode=1 & TASK_STOP : ACCEPTED
DO_SET_MODE 1 4 to=autopilot : ACCEPTED it MOVES
fault & wait 3.1 : - it STANDS / mode hold / it is IDLE / queue STOPPED
""",
    )


@for_each("silence", [4.0, 4.1, 4.2])  # HOLD is sent every 0.25 s
def test_a_silent_rover_is_stopped_when_it_is_heard_again(world: World, silence: float) -> None:
    drive(world)
    world.fault(Faults(silent=True, deaf=True))
    world.run(silence)
    stop = world.client.stop()
    world.run(1)
    assert stop.answer == (FAILED, R.VEHICLE_SILENT)
    assert world.paused() is R.STOPPED
    world.run(10)
    world.operator_mode(Mode.AUTO)  # somebody at the rover, who knows nothing of the STOP
    world.rover.autopilot.parameters["WP_SPEED"] = 1.0
    world.run(3)
    assert not world.stands()

    world.fault(Faults(deaf=True))
    world.until(lambda: world.server.engine.snapshot(now=world.now).vehicles[0].heard, within=2)
    at = world.now - 0.03
    assert world.observer.sent_since(at)[:2] == ["HOLD", "zero"]
    world.fault(Faults())
    world.until(lambda: stands_in_hold(world), within=BRAKING)


@for_each("seed", range(3))
def test_stop_through_a_lossy_net(make_world: MakeWorld, seed: int) -> None:
    bad = Conditions(delay=0.005, jitter=0.1, loss=0.3, duplication=0.1)
    world = make_world(seed=seed, conditions=bad)
    world.client.move(20, repeats=REPEATS, nonce=1)
    world.run(4)
    world.client.stop(repeats=tuple(k * 0.2 for k in range(12)))
    world.until(lambda: stands_in_hold(world), within=9)  # or four heartbeats in a row are lost
    world.run(3)
    where = world.pose()
    assert stands_in_hold(world)
    world.run(4)
    assert world.pose() == where


def test_stop_does_not_wait_for_the_store(make_world: MakeWorld) -> None:
    store = LateStore()
    world = make_world(store=store)
    drive(world)
    store.delay = float("inf")
    stop = world.client.stop()
    world.until(lambda: stop.ack, within=0.1)
    world.until(lambda: stands_in_hold(world), within=BRAKING)
