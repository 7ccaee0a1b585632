"""What was asked for before a halt, and had not begun by then, does not move the rover after it.

A plan with a start delay, a mission that begins when the rover is armed, a client that was given
control, a task that stands only while the rover is not heard, a command that waits for the answer
to another: each of them did.
"""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    GUIDED,
    HOLD,
    MOVE,
    FakeClient,
    Message,
    command_long,
    setpoint,
)
from tests.kit.mission import Item
from tests.kit.px4 import HOLD as PX4_HOLD
from tests.kit.px4 import MISSION, PROMPT_PX4, ask_mode
from tests.kit.rows import check
from tests.kit.world import World, at, near_pose, put_home
from tests.scenarios.conftest import MakeWorld

WAYPOINT, OPTIONS, START, RETURN, STANDARD_MODE = 16, 54014, 300, 20, 262
SECOND_MISSION = 5  # MAV_STANDARD_MODE: mission
ELSEWHERE = (1, 42)  # a component that nobody has heard of


def by_switch(world: World, person: FakeClient) -> None:
    """Let a person take the rover at its transmitter, and park it."""
    del person
    world.operator_mode(Mode.MANUAL)
    world.run(2)
    world.operator_mode(Mode.HOLD)


HALTS: dict[str, Callable[[World, FakeClient], object]] = {
    "HOLD": lambda _, person: person.mode(HOLD),
    "pause": lambda _, person: person.pause(),
    "switch": by_switch,
    "disarm": lambda _, person: person.arm(False),
}


def stays(world: World, seconds: float) -> bool:
    """Return whether the rover stands soon, and then does not move for so long."""
    world.until(world.stands, within=2)
    before = world.pose()
    for _ in range(int(seconds / 0.2)):
        world.run(0.2)
        if not near_pose(world.pose(), before, metres=0.03):
            return False
    return True


def away_from_home(world: World) -> None:
    """Drive the rover to where a return moves it, and arm it there."""
    put_home(world, 0.0, 0.0)
    world.client.move(5)
    world.until_state(1, S.COMPLETED, within=60)
    world.run(3)
    world.client.arm()
    world.run(2)


def unheard(world: World) -> None:
    """Let nothing that the rover says arrive, and all that it is told."""
    world.watched.loses = lambda source, _target, _data: source == "rover1"


def stored(world: World, *items: Item, target: tuple[int, int] = (1, 1)) -> None:
    """Upload a plan."""
    assert world.upload(items, target=target).result == 0


def started_under_a_pause(world: World, delay: float) -> None:
    """Start a plan that begins a while later; as the queue is paused, it runs before that."""
    world.client.arm()
    options = Item(OPTIONS, param1=5, param2=delay, param4=0)
    stored(world, Item(WAYPOINT, frame=0, current=1), options, Item(WAYPOINT, **at(6.0, 0.0)))
    world.client.pause()
    world.run(1)
    started = world.client.command(START, target=(1, 1))
    world.run(1)
    assert started.result == ACCEPTED


@for_each("halt", HALTS)
def test_a_plan_that_was_started_does_not_begin_after_a_halt(world: World, halt: str) -> None:
    person = world.add_client("person")
    started_under_a_pause(world, 25)
    HALTS[halt](world, person)
    world.run(1)
    assert stays(world, 40)
    going = world.client.proceed()
    world.until_state(1, S.COMPLETED, within=60)
    assert going.result == ACCEPTED


@for_each("hears", [True, False])
def test_disarming_ends_what_waits_for_a_silent_rover(world: World, hears: bool) -> None:
    """Whether it was carried out nobody knows until the rover is heard again."""
    person = world.add_client("person")
    world.client.move(20)
    world.until_faster(0.3)
    world.watched.loses = lambda source, target, _: (
        source == "rover1" or (target == "rover1" and not hears)
    )
    world.run(5)
    assert world.state(1)[0] is S.PAUSED
    person.arm(False)
    world.run(1)
    world.watched.loses = lambda _source, _target, _data: False
    world.run(1)
    world.operator_arm(True)
    assert stays(world, 10)
    assert world.paused() is R.OPERATOR


@for_each("halt", ["disarm", "pause", "switch"])
def test_a_mission_does_not_begin_at_an_arming_after_a_halt(
    make_world: MakeWorld, halt: str
) -> None:
    """Towards a PX4 a mission mode on the ground begins it when the rover is armed."""
    world = make_world(persona=PROMPT_PX4)
    stored(world, Item(WAYPOINT, **at(3.0, 0.0)), target=(1, 191))
    marked = ask_mode(world.client, MISSION)
    world.run(1)
    assert marked.result == ACCEPTED
    person = world.add_client("person")
    world.run(1)
    HALTS[halt](world, person)
    world.run(1)
    world.operator_arm(True)
    assert stays(world, 8)


@for_each("halt", ["disarm", "switch"])
def test_a_stream_does_not_drive_on_when_the_rover_may_move_again(world: World, halt: str) -> None:
    """Both at the rover itself: no client has said anything."""
    world.client.mode(GUIDED)
    world.client.arm()
    world.run(1)
    world.client.stream(setpoint(0.5), rate=10)
    world.run(3)
    assert world.truth.forward_speed > 0.3
    if halt == "disarm":
        world.operator_arm(False)
        world.run(3)
        world.operator_arm(True)
    else:
        world.operator_mode(Mode.HOLD)
        world.run(3)
        world.operator_mode(Mode.GUIDED)
    assert stays(world, 4)
    world.client.mode(GUIDED)
    world.run(2)
    assert world.truth.forward_speed > 0.3, "its client has asked for the mode again"


@for_each("mode", [Mode.MANUAL, Mode.GUIDED])
def test_a_rover_that_somebody_drove_and_parked_stays_there(world: World, mode: Mode) -> None:
    """In GUIDED by another radio than ours."""
    world.client.arm()
    world.run(1)
    world.client.command(MOVE, 3, 0, 0, 0, 0, 20, 5)
    world.run(1)
    world.operator_mode(mode)
    link = world.net.link("another radio")
    for _ in range(40):
        link.send("rover1", packed(setpoint(0.5)))
        world.run(0.2)
    world.operator_mode(Mode.HOLD)
    world.run(3)
    assert stays(world, 30)
    assert world.paused() is R.TAKEOVER


def packed(message: Message) -> bytes:
    """Pack a message as another ground station does."""
    return bytes(message.pack(common.MAVLink(None, 254, 190)))


@for_each("halt", ["HOLD", "pause", "STOP"])
def test_what_waits_behind_an_unanswered_command_does_not_leave_after_a_halt(
    make_world: MakeWorld, halt: str
) -> None:
    """A mode that the rover refused, its answer lost; the next one waited for that."""
    world = make_world(persona=PROMPT_PX4)
    person = world.add_client("person")
    away_from_home(world)
    world.lose_acks()
    world.client.send(command_long(STANDARD_MODE, 77, target=(1, 1)))
    world.run(0.55)
    world.client.send(command_long(STANDARD_MODE, SECOND_MISSION, target=(1, 1)))
    world.run(0.05)
    halts = {"HOLD": lambda: ask_mode(person, PX4_HOLD), "pause": person.pause, "STOP": person.stop}
    halted = halts[halt]()
    world.run(0.1)
    assert halted.result == ACCEPTED
    assert stays(world, 6)


# a release under a pause


PAUSES = ("pause", "HOLD", "takeover")


def held_and_paused(world: World, how: str) -> None:
    """Have a task held, and then the queue paused."""
    world.client.move(10)
    world.until_faster(0.3)
    world.fault(Faults(position_jump=(5.0, 0.0)))
    world.until_state(1, S.HELD, within=2)
    world.run(3)
    if how == "pause":
        world.add_client("person").pause()
    elif how == "HOLD":
        world.add_client("person").mode(HOLD)
    else:
        world.operator_mode(Mode.MANUAL)
        world.run(2)
        world.operator_mode(Mode.HOLD)
    world.run(5)


@for_each("how", PAUSES)
def test_it_waits_for_the_continue_and_then_goes_on(world: World, how: str) -> None:
    held_and_paused(world, how)
    before = world.pose()
    words = "Task 1 waits: released; press Continue to start it"
    check(world, f"TASK_RELEASE 1 0 & wait 5 : ACCEPTED #1 / task 1: HELD / {words}")
    assert world.pose() == pytest.approx(before, abs=0.001)
    check(world, "CONTINUE & until 1 EXECUTING within=5 : ACCEPTED")


@for_each("how", PAUSES)
def test_the_next_halt_takes_it_back(world: World, how: str) -> None:
    held_and_paused(world, how)
    check(
        world,
        """
TASK_RELEASE 1 0 & wait 1 : ACCEPTED
another> PAUSE & wait 5 : ACCEPTED
""",
        another=world.add_client("another"),
    )
    before = world.pose()
    check(world, "CONTINUE & wait 4 : ACCEPTED task 1: HELD")
    assert world.pose() == pytest.approx(before, abs=0.001)
