"""What was to arm a rover, and comes to it after it was to be disarmed, does not let it go.

The net between server and rover puts packets in another order, too. Whatever is seen armed may be
taken by a task that waits: the rover of somebody who had armed it, thought better of it, and was
answered that it is disarmed, drove off.
"""

from struct import unpack_from

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, GUIDED
from tests.kit.world import World
from tests.scenarios.attacks.test_left_waiting import away_from_home, stays
from tests.scenarios.conftest import MakeWorld

COMMAND_LONG, ARM = 76, 400
PARAMETERS, NUMBER = 10, 38  # where they begin in a packet, and the command's number


def is_arming(data: bytes) -> bool:
    """Whether a packet of MAVLink 2 is a command that arms."""
    if data[7] != COMMAND_LONG:
        return False
    filled = data[: PARAMETERS + data[1]] + bytes(NUMBER)
    return (unpack_from("<H", filled, NUMBER), unpack_from("<f", filled, PARAMETERS)) == (
        (ARM,),
        (1.0,),
    )


def catch_arming(world: World) -> list[bytes]:
    """Keep the next command that arms from the rover; it is put into the list."""
    caught: list[bytes] = []

    def loses(_source: str, target: str, data: bytes) -> bool:
        is_it = target == "rover1" and not caught and is_arming(data)
        caught.extend([data] if is_it else [])
        return is_it

    world.watched.loses = loses
    return caught


def disarmed_at_last(world: World) -> None:
    """Have the client disarm the rover until that is acknowledged as done."""
    for _ in range(2):  # the first waits for what the net has lost, and is not answered
        answer = world.client.arm(False)
        world.run(0.6)
    assert answer.result == ACCEPTED


@anew
def waiting(world: World) -> World:
    """A rover that a client has disarmed, and a task that waits for its arming."""
    world.operator_mode(Mode.HOLD)
    world.run(2)
    world.client.arm(False)
    world.run(3)
    world.client.move(5, speed=0.5)
    world.run(3)
    assert world.state(1)[0] is S.QUEUED
    return world


def test_an_arming_that_its_disarming_has_overtaken_begins_no_task(waiting: World) -> None:
    caught = catch_arming(waiting)
    waiting.client.arm()
    waiting.run(0.1)
    assert caught
    waiting.watched.loses = lambda *_: False
    disarmed_at_last(waiting)
    waiting.bring_late(caught[0])
    waiting.run(2)
    assert stays(waiting, 6)
    assert not waiting.rover.autopilot.armed
    assert waiting.state(1)[0] is S.QUEUED
    assert waiting.paused() is R.OPERATOR


def test_our_own_arming_is_called_back_as_well(world: World) -> None:
    caught = catch_arming(world)
    world.client.move(5, speed=0.5)
    world.until(lambda: bool(caught), within=5)
    world.watched.loses = lambda *_: False
    disarmed_at_last(world)
    world.bring_late(caught[0])
    world.run(2)
    assert stays(world, 3)
    assert not world.is_armed


def test_nor_does_one_arm_it_that_comes_after_a_stop(world: World) -> None:
    caught = catch_arming(world)
    world.client.move(5, speed=0.5)
    world.until(lambda: bool(caught), within=5)
    world.watched.loses = lambda *_: False
    world.client.stop()
    world.run(0.5)
    world.bring_late(caught[0])
    world.run(2)
    assert stays(world, 3)
    assert not world.is_armed


def test_a_pause_stops_what_a_client_has_armed_just_now(world: World) -> None:
    """No heartbeat has shown it yet."""
    away_from_home(world)
    world.client.arm(False)
    world.run(2)
    world.client.mode(GUIDED)
    world.run(1.5)
    world.client.arm()
    world.run(0.02)
    paused = world.client.pause()
    world.run(3)
    assert paused.result == ACCEPTED
    assert world.mode() is Mode.HOLD


@for_each("phase", [0.0, 0.2, 0.4, 0.6, 0.8])
@for_each("late", [2.0, 2.6, 3.0, 3.4])
def test_an_arming_that_shows_only_with_the_next_heartbeat(
    make_world: MakeWorld, late: float, phase: float
) -> None:
    """It came in time to be called late; a rover that says once a second shows it after that."""
    world = make_world(persona=ARDUPILOT)
    world.operator_mode(Mode.HOLD)
    world.run(2)
    world.client.arm(False)
    world.run(3)
    world.client.move(5, speed=0.5)
    world.run(3 + phase)
    caught = catch_arming(world)
    world.client.arm()
    world.run(0.5)
    world.watched.loses = lambda *_: False
    answer = world.client.arm(False)
    world.run(late)
    assert answer.result == ACCEPTED
    world.bring_late(caught[0])
    assert stays(world, 6)
