"""A copy is known for one by what came before it, and each copy is remembered, answered or not.

A "go to" that runs at once came three times, 3 s apart; a person stopped the rover after the second
copy, and the third drove it on. The first packet of a silent sender, delivered again, passed for
that of a program that was run again.
"""

from collections.abc import Callable
from dataclasses import replace
from math import nan

from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Settings
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, HOLD, PAUSE_CONTINUE, FakeClient, command_long
from tests.kit.mission import Item
from tests.kit.px4 import REPOSITION
from tests.kit.world import World, at
from tests.scenarios.attacks.test_left_waiting import stays
from tests.scenarios.conftest import MakeWorld

WAYPOINT, REQUEST, CANCEL = 16, 512, 54010
APART = 3.0  # s, as QGroundControl asks again
HALTS: dict[str, Callable[[World, FakeClient], object]] = {
    "HOLD": lambda _, person: person.mode(HOLD),
    "pause": lambda _, person: person.pause(),
    "cancel": lambda _, person: person.command(CANCEL, 0),
    "switch": lambda world, _: world.operator_mode(Mode.HOLD),
}


def go_to(north: float) -> object:
    """Return "go to" as a command."""
    place = at(north, 0.0)
    return common.MAVLink_command_int_message(
        1, 1, 6, REPOSITION, 0, 0, -1, 1, 0, nan, place["x"], place["y"], 0
    )


@for_each("copies", [3, 4])
@for_each("way", ["command", "item"])
@for_each("halt", HALTS)
def test_copies_of_what_runs_at_once_undo_no_newer_halt(
    make_world: MakeWorld, halt: str, way: str, copies: int
) -> None:
    world = make_world(settings=replace(Settings(), guided="now"))
    person = world.add_client("person")
    item = Item(WAYPOINT, **at(30.0, 0.0), current=2).message(0, 0, (1, 1))
    word = go_to(30.0) if way == "command" else item
    world.client.arm()
    world.run(1)
    world.client.mode(HOLD)
    world.run(2)
    for _ in range(copies - 1):
        world.client.send(word)
        world.run(APART)
    assert world.truth.forward_speed > 0.3
    HALTS[halt](world, person)
    world.client.send(word)
    world.run(0.8)
    assert stays(world, 6)


def test_a_first_packet_that_comes_again_and_again_undoes_no_newer_halt(world: World) -> None:
    """It has number 0, by which a program that is run again is known."""
    person, script = world.add_client("person"), world.add_client("script", system_id=245)
    script.heartbeats = False
    world.client.move(30)
    world.until_faster(0.3)
    world.client.pause()
    world.run(3)
    first = script.send(command_long(PAUSE_CONTINUE, 1))
    assert first[4] == 0
    world.run(1)
    script.send(command_long(REQUEST, 0))
    world.run(1)
    halted = person.pause()
    world.run(8)
    assert halted.result == ACCEPTED
    for _ in range(3):
        script.send_raw(first)
        world.run(6)
    assert stays(world, 5)
