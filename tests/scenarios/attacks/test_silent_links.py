"""HOLD was acknowledged while nothing came through to the rover: it holds when that ends."""

from collections.abc import Callable

from mav_tasks.config.settings import Settings
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, HOLD, RTL, command_long
from tests.kit.world import World
from tests.scenarios.attacks.test_late_to_the_rover import mend
from tests.scenarios.attacks.test_left_waiting import ELSEWHERE, RETURN, away_from_home


def cut(world: World) -> None:
    """Let nothing through between server and rover, either way."""
    world.watched.loses = lambda source, target, _: "rover1" in (source, target)


@for_each("claim", [True, False])
@for_each("halt", ["HOLD", "pause"])
@for_each("seconds", [4.0, 6.0, 45.0])
def test_a_halt_during_a_gap_counts_when_it_ends(
    make_world: Callable[..., World], halt: str, claim: bool, seconds: float
) -> None:
    world = make_world(settings=Settings(claim=claim))
    person = world.add_client("person")
    away_from_home(world)
    if claim:
        world.client.send(command_long(RETURN, target=ELSEWHERE))
    else:
        world.client.mode(RTL)
    world.run(1)
    assert world.mode() is Mode.RTL
    cut(world)
    said = person.mode(HOLD) if halt == "HOLD" else person.pause()
    world.run(seconds)
    assert said.result == ACCEPTED
    mend(world)
    world.run(4)
    assert world.mode() is Mode.HOLD
