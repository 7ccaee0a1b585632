"""What holds beats every older word that lets go: attacks D1 and D2, and the way back for people.

A continue, a start, a mode, an arming that was sent before a halt does not undo it, however often
its copies come and by whatever way; the person who means it sends it anew, and is told so.
"""

from collections.abc import Callable

from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import (
    ACCEPTED,
    ARM,
    AUTO,
    GUIDED,
    HOLD,
    PAUSE_CONTINUE,
    SET_MODE,
    TEMPORARILY_REJECTED,
    FakeClient,
    Message,
    command_long,
    set_mode,
)
from tests.kit.mission import Item
from tests.kit.world import World, at

STALE = (TEMPORARILY_REJECTED, R.STALE)
MISSION_START, WAYPOINT = 300, 16
CONTINUE = command_long(PAUSE_CONTINUE, 1)

#: what makes the rover stand, said by another than who let it go
HALTS: dict[str, Callable[[World, FakeClient], object]] = {
    "STOP": lambda _, other: other.stop(),
    "HOLD": lambda _, other: other.mode(HOLD),
    "SET_MODE": lambda _, other: other.send(set_mode(HOLD)),
    "pause": lambda _, other: other.pause(),
    "disarm": lambda _, other: other.arm(False),
    "cancel": lambda _, other: other.command(54010, 0),
    "mode switch": lambda world, _: world.operator_mode(Mode.HOLD),
    "disarmed at the rover": lambda world, _: world.operator_arm(False),
}


def copies(client: FakeClient, message: Message, count: int, world: World, *, each: float) -> None:
    """Send a word again and again, counted, as a client does that hears no answer."""
    for confirmation in range(1, count + 1):
        world.run(each)
        if hasattr(message, "confirmation"):
            message.confirmation = confirmation
        client.send(message)


def driven_since(world: World, seconds: float) -> float:
    """Return how far the rover really gets from where it stands now."""
    before = world.pose()
    world.run(seconds)
    after = world.pose()
    return abs(after[0] - before[0]) + abs(after[1] - before[1])


@for_each("halt", HALTS)
def test_copies_of_a_continue_undo_no_newer_halt(world: World, halt: str) -> None:
    """D1: what a script repeats for 10 s is older than what a person has done in between."""
    script, person = world.add_client("script", system_id=245), world.add_client("person")
    script.move(10)
    world.until_state(1, S.EXECUTING)
    person.pause()
    world.run(4)
    message = command_long(PAUSE_CONTINUE, 1)
    script.send(message)
    world.run(0.2)
    assert script.acks_of(PAUSE_CONTINUE)[-1][0] == ACCEPTED
    world.run(1.5)
    HALTS[halt](world, person)
    world.run(0.3)
    copies(script, message, 20, world, each=0.5)
    assert driven_since(world, 3) < 0.001
    assert world.stands()
    if halt != "cancel":  # which leaves the queue to go on
        assert set(script.acks_of(PAUSE_CONTINUE)[-15:]) == {STALE}


@for_each("halt", ["HOLD", "pause", "disarm", "mode switch"])
@for_each("way", ["MISSION_START", "DO_SET_MODE", "SET_MODE"])
def test_copies_of_a_start_undo_no_newer_halt(world: World, halt: str, way: str) -> None:
    """D1: ground stations repeat the start of a mission, and the mode for it, without an answer."""
    station, person = world.client, world.add_client("person")
    plan = (Item(WAYPOINT, frame=0, current=1), Item(WAYPOINT, **at(6.0, 0.0)))
    world.upload(plan, client=station)
    word = {
        "MISSION_START": command_long(MISSION_START, target=(1, 1)),
        "DO_SET_MODE": command_long(SET_MODE, 1, AUTO, target=(1, 1)),
        "SET_MODE": set_mode(AUTO),
    }[way]
    station.send(word)
    world.until_faster(0.3)
    station.send(word)
    world.run(0.5)
    HALTS[halt](world, person)
    world.run(1.5)
    copies(station, word, 6, world, each=1.0)
    assert driven_since(world, 2) < 0.001


def test_copies_of_an_arming_do_not_arm_what_was_disarmed_since(world: World) -> None:
    station, person = world.client, world.add_client("person")
    word = command_long(ARM, 1, target=(1, 1))
    station.send(word)
    world.run(1)
    person.arm(False)
    world.run(1)
    copies(station, word, 5, world, each=1.0)
    world.run(1)
    assert not world.is_armed


@for_each("apart", [0.0, 0.02, 5.0])
@for_each("halt", ["STOP", "HOLD", "pause"])
def test_a_continue_that_its_senders_own_halt_has_overtaken_does_not_count(
    world: World, halt: str, apart: float
) -> None:
    """D2: the net put them in the wrong order, their sender did not."""
    client = world.client
    client.move(20)
    world.until_state(1, S.EXECUTING)
    world.add_client("person").pause()
    world.run(4)
    overtaken = client.packed(CONTINUE)
    client.send(command_long(512, 148))  # takes the next number: as if that had been the continue
    HALTS[halt](world, client)
    world.run(apart)
    client.send_raw(overtaken)
    assert driven_since(world, 3) < 0.001
    assert world.paused() is (R.STOPPED if halt == "STOP" else R.OPERATOR)


@for_each("halt", ["STOP", "HOLD", "disarm"])
def test_what_mavsdk_repeats_by_itself_does_not_undo_its_own_halt(world: World, halt: str) -> None:
    """Its repetitions have a number of their own, and no count."""
    client = world.client
    client.move(20)
    world.until_state(1, S.EXECUTING)
    world.add_client("person").pause()
    world.run(4)
    client.send(CONTINUE)
    world.run(0.4)
    HALTS[halt](world, client)
    for _ in range(3):
        world.run(0.4)
        client.send(command_long(PAUSE_CONTINUE, 1))
    assert driven_since(world, 3) < 0.2  # on its way to a stand
    assert world.stands()


# people are not locked out


@for_each("drives", [AUTO, GUIDED])
def test_a_mode_that_drives_counts_at_once_after_the_hold_of_the_same_client(
    world: World, drives: int
) -> None:
    """MAVSDK's start, pause and start again: it has one command of a number under way at a time."""
    world.client.move(20)
    world.until_state(1, S.EXECUTING)
    for _ in range(5):
        world.client.mode(HOLD)
        world.run(0.1)
        going = world.client.mode(drives)
        world.run(0.3)
        assert going.result == ACCEPTED


def test_a_script_that_is_run_again_from_the_same_port_is_heard(world: World) -> None:
    """MAVSDK at 14540, say: each run counts its packets from 0, and sends the very same ones."""
    for _ in range(3):
        script = world.client
        script.count_anew()
        script.send(command_long(512, 148, target=(1, 1)))
        world.run(0.1)
        script.send(command_long(512, 148, target=(1, 1)))
        world.run(0.3)
        armed = script.arm()
        world.run(1)
        assert armed.result == ACCEPTED
        script.arm(False)
        world.run(0.5)
        for _ in range(20):
            script.send(command_long(512, 148, target=(1, 1)))
        script.heartbeats = False
        world.run(4)
        script.heartbeats = True


def test_a_refusal_says_what_came_and_what_to_do_and_4_s_later_it_counts(world: World) -> None:
    script, person = world.add_client("script", system_id=245), world.add_client("person")
    script.move(20)
    world.until_state(1, S.EXECUTING)
    person.pause()
    world.run(4)
    script.proceed()
    world.run(1)
    person.pause()
    world.run(0.2)
    refused = script.proceed()
    world.run(0.2)
    assert refused.answer == STALE
    words = "a pause by 255/190 came later: wait 4 s and repeat it if you mean it"
    assert script.texts()[-1] == words
    world.run(4)
    going = script.proceed()
    world.run(0.2)
    assert going.answer == (ACCEPTED, 1)
