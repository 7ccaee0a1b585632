"""A word that goes on to the rover is ordered as one that the server sees to itself.

A return or a "go to" that is sent to a component that nobody has heard of, or to a server that
claims none of these, is carried out by the autopilot: a copy of it undid a HOLD. So did a "go to"
towards a PX4 that had left before its own sender's HOLD, or was a copy from before that.
"""

from math import nan
from typing import Any

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import (
    ACCEPTED,
    AUTO,
    GUIDED,
    HOLD,
    SET_MODE,
    TEMPORARILY_REJECTED,
    command_long,
    set_mode,
)
from tests.kit.px4 import HOLD as PX4_HOLD
from tests.kit.px4 import PROMPT_PX4, REPOSITION, ask_mode
from tests.kit.world import World, at
from tests.scenarios.attacks.test_left_waiting import ELSEWHERE, RETURN, away_from_home, stays
from tests.scenarios.conftest import MakeWorld

CHANGE_MODE = 1  # of DO_REPOSITION
COMMAND_LONG = 76


def go_to(north: float, east: float, target: tuple[int, int] = (1, 1)) -> Any:
    """Return a "go to" that also asks for the mode in which it is driven."""
    place = at(north, east)
    return common.MAVLink_command_int_message(
        *target, 6, REPOSITION, 0, 0, -1, CHANGE_MODE, 0, nan, place["x"], place["y"], 0
    )


@for_each("what", ["return", "go to"])
@for_each("claim", [True, False])
def test_a_copy_of_what_was_passed_on_does_not_undo_a_hold(
    make_world: MakeWorld, what: str, claim: bool
) -> None:
    world = make_world(settings=Settings(claim=claim))
    person = world.add_client("person")
    away_from_home(world)
    target = ELSEWHERE if claim else (1, 1)
    word = command_long(RETURN, target=target) if what == "return" else go_to(20, 0, target)
    world.client.send(word)
    world.run(1)
    assert world.mode() in (Mode.RTL, Mode.GUIDED), "it was passed on"
    held = person.mode(HOLD)
    world.run(2)
    assert held.result == ACCEPTED
    if what == "return":
        word.confirmation = 1
    world.client.send(word)
    assert stays(world, 5)
    number = RETURN if what == "return" else REPOSITION
    assert world.client.acks_of(number)[-1] == (TEMPORARILY_REJECTED, R.STALE)
    world.run(4)
    if what == "return":
        word.confirmation = 0
    world.client.send(word)
    world.run(2)
    assert world.mode() in (Mode.RTL, Mode.GUIDED), "it was meant"


@for_each("way", ["command", "message", "elsewhere"])
@for_each("halt", ["HOLD", "pause"])
def test_what_the_net_to_the_rover_delivers_after_a_halt_does_not_undo_it(
    world: World, halt: str, way: str
) -> None:
    """It is overtaken between the server and the rover."""
    person = world.add_client("person")
    away_from_home(world)
    world.client.mode(GUIDED)
    world.run(1)
    caught: list[bytes] = []

    def loses(_source: str, target: str, data: bytes) -> bool:
        is_it = target == "rover1" and data[7] in (SET_MODE, COMMAND_LONG) and not caught
        caught.extend([data] if is_it else [])
        return is_it

    world.watched.loses = loses
    match way:
        case "command":
            world.client.mode(AUTO)
        case "message":
            world.client.send(set_mode(AUTO))
        case _:
            world.client.send(command_long(RETURN, target=ELSEWHERE))
    world.run(0.1)
    assert caught
    world.watched.loses = lambda *_: False
    halted = person.mode(HOLD) if halt == "HOLD" else person.pause()
    world.run(0.5)
    assert halted.result == ACCEPTED
    world.bring_late(caught[0])
    world.run(2)
    assert world.mode() is Mode.HOLD
    assert stays(world, 5)


def test_a_person_at_the_rover_has_it_all_the_same(world: World) -> None:
    """Though a client had asked for something just before the HOLD."""
    away_from_home(world)
    world.client.send(command_long(RETURN, target=ELSEWHERE))
    world.run(0.5)
    world.add_client("person").mode(HOLD)
    world.run(1)
    world.operator_mode(Mode.MANUAL)
    world.run(3)
    assert world.mode() is Mode.MANUAL


def test_a_mode_asked_for_before_a_halt_is_no_clients_after_it(world: World) -> None:
    """It was lost on the way; the same mode, from the rover, is a person's."""
    person = world.add_client("person")
    away_from_home(world)
    world.watched.loses = lambda _source, target, _data: target == "rover1"
    world.client.send(set_mode(GUIDED))
    world.run(0.2)
    world.watched.loses = lambda *_: False
    person.pause()
    world.run(0.2)
    person.proceed()
    world.run(0.2)
    world.operator_mode(Mode.GUIDED)
    world.run(1)
    person.move(1)
    world.run(2)
    assert world.state(2)[0] is S.QUEUED, "a person has the rover"


@anew
def px4(make_world: MakeWorld) -> World:
    world = make_world(persona=PROMPT_PX4)
    world.client.move(20, speed=0.5)
    world.until_faster(0.45)
    return world


def test_a_go_to_that_its_senders_hold_has_overtaken_does_not_undo_it(px4: World) -> None:
    late = px4.client.send_repeated(go_to(5, 5))
    held = ask_mode(px4.client, PX4_HOLD)
    px4.run(0.05)
    assert held.result == ACCEPTED
    px4.client.send_raw(late)
    px4.run(2)
    assert stays(px4, 4)
    assert px4.paused() is R.OPERATOR


def test_nor_does_a_copy_of_one_from_before_that(px4: World) -> None:
    """As QGroundControl sends it, 3 s later."""
    px4.client.send(go_to(5, 5))
    px4.run(2.7)
    held = ask_mode(px4.client, PX4_HOLD)
    px4.run(0.3)
    assert held.result == ACCEPTED
    px4.client.send(go_to(5, 5))
    px4.run(2)
    assert stays(px4, 4)
