"""Where nobody can know whether a word is older than a halt, it does not let the rover go.

The net keeps one packet of a client back, and brings it after somebody's halt was acknowledged;
others of that client have overtaken it. A word that is new counts, and a refused one may be sent
again.
"""

from collections.abc import Callable

from mav_tasks.tasks.lifecycle import TaskReason as R
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    HOLD,
    MOVE,
    PAUSE_CONTINUE,
    SET_MODE,
    STOP,
    FakeClient,
    Sent,
    command_long,
    heartbeat,
)
from tests.kit.volume import some
from tests.kit.world import World
from tests.scenarios.attacks.test_left_waiting import stays

CANCEL, CLEAR = 54010, 54011
CONTINUE = command_long(PAUSE_CONTINUE, 1)
HALTS: dict[str, Callable[[FakeClient], Sent]] = {
    "pause": lambda person: person.pause(),
    "HOLD": lambda person: person.mode(HOLD),
    "STOP": lambda person: person.stop(),
    "disarm": lambda person: person.arm(False),
}


@anew
def other(world: World) -> FakeClient:
    """Another station than the one that halts."""
    return world.add_client("other", system_id=245)


def paused_while_driving(world: World) -> None:
    """Let a task of two run and be paused."""
    world.client.move(60, speed=0.5)
    world.until_faster(0.3)
    world.client.move(30, speed=0.5)
    world.client.pause()
    world.run(4)


@for_each("late", [2.0, 6.0, 15.0])
@for_each("before", some([0.1, 0.5, 0.8], 0, 2))
@for_each("halt", HALTS)
def test_what_left_within_the_second_before_a_halt(
    world: World, other: FakeClient, halt: str, before: float, late: float
) -> None:
    """The sender's next heartbeat comes after the halt, and overtakes it: which was first?"""
    paused_while_driving(world)
    beats: list[float] = []
    other.on_sent = lambda message, _: beats.extend([world.now] * (message.get_msgId() == 0))
    world.until(lambda: bool(beats), within=2)
    world.run(0.9 - before)
    old = other.send_repeated(CONTINUE)
    world.run(before - 0.05)
    halted = HALTS[halt](world.client)
    world.run(late)
    assert halted.result == ACCEPTED
    other.send_raw(old)
    assert stays(world, 5)
    assert world.paused() is not R.NONE


@for_each("first", ["pause", "HOLD", "STOP", "cancel"])
@for_each("halt", HALTS)
def test_a_second_copy_of_an_older_halt_takes_no_later_ones_place(
    world: World, other: FakeClient, halt: str, first: str
) -> None:
    world.client.move(60, speed=0.5)
    world.until_faster(0.3)
    words = {
        "pause": command_long(PAUSE_CONTINUE, 0),
        "HOLD": command_long(SET_MODE, 1, HOLD, target=(1, 1)),
        "STOP": command_long(STOP),
        "cancel": command_long(CANCEL, 77),
    }
    older = other.send(words[first])
    world.run(1.5)
    old = other.send_repeated(CONTINUE)
    world.run(1.5)
    halted = HALTS[halt](other)
    world.run(5)
    assert halted.result == ACCEPTED
    other.send_raw(older)
    world.run(0.1)
    other.send_raw(old)
    assert stays(world, 5)


@for_each("rate, late", [(25, 6.5), (10, 14.0)])
@for_each("halt", HALTS)
def test_what_its_senders_eight_bits_call_far_ahead(
    world: World, other: FakeClient, halt: str, rate: float, late: float
) -> None:
    """A station with a joystick sends 25 packets a second: 128 of them in five seconds."""
    paused_while_driving(world)
    other.stream(heartbeat(), rate=rate)
    world.run(3)
    old = other.send_repeated(CONTINUE)
    world.run(1)
    halted = HALTS[halt](world.client)
    world.run(late - 1)
    assert halted.result == ACCEPTED
    other.send_raw(old)
    assert stays(world, 4)


@for_each("gap", [0.5, 12.0])
@for_each("halt", HALTS)
def test_the_same_packet_from_another_port(
    world: World, other: FakeClient, halt: str, gap: float
) -> None:
    """Or by a second link, which may be so slow; who sent it first is still there."""
    paused_while_driving(world)
    copy = other.send(CONTINUE)
    world.run(0.5)
    halted = HALTS[halt](world.client)
    world.run(gap)
    assert halted.result == ACCEPTED
    elsewhere = world.add_client("other port", system_id=245)
    elsewhere.heartbeats = elsewhere.reads_dialect = False
    elsewhere.send_raw(copy)
    world.run(1)
    assert stays(world, 4)
    assert world.paused() is not R.NONE


@for_each("halt", ["HOLD", "everything"])
def test_a_submission_that_had_left_before_somebody_elses_halt(
    world: World, other: FakeClient, halt: str
) -> None:
    world.run(3)
    late = other.send_repeated(command_long(MOVE, 3, 0.5, 0, 7, 0, 0, 5))
    world.run(1.5)
    halted = world.client.mode(HOLD) if halt == "HOLD" else world.client.command(CLEAR, 1)
    world.run(2)
    assert halted.result == ACCEPTED
    other.send_raw(late)
    assert stays(world, 6)
