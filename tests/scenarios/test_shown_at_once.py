"""What a client has changed it sees in a heartbeat at once, not at the rover's next second."""

from typing import Any

from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, heartbeat
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

MAKES = for_each("persona", [ARDUPILOT, PX4, GENERIC])
SOON = 0.1  # s; beats are a second apart


def shown(world: World) -> Any:
    """The rover's last heartbeat as the client has it."""
    return [world.client.decoded(p) for p in world.client.of_id(0) if p.source == (1, 1)][-1]


def away_from_a_beat(world: World) -> World:
    """Let time pass until a heartbeat has just come: the next one is a second away."""
    before = len(list(world.client.of_id(0)))
    world.until(lambda: len(list(world.client.of_id(0))) > before, within=2)
    world.run(0.2)
    return world


@MAKES
def test_a_mode_that_is_set_by_command(make_world: MakeWorld, persona: Persona) -> None:
    world = away_from_a_beat(make_world(persona=persona))
    for mode in (Mode.MANUAL, Mode.HOLD):
        number = persona.modes.numbers[mode]
        main_and_sub = (number >> 16 & 0xFF, number >> 24) if number > 0xFFFF else (number,)
        sent = world.client.command(176, 1, *main_and_sub, target=(1, 1))
        world.run(SOON)
        assert sent.result == ACCEPTED
        assert shown(world).custom_mode == number


def test_a_question_of_a_client_is_answered_beside_ours(make_world: MakeWorld) -> None:
    world = away_from_a_beat(make_world(persona=ARDUPILOT))
    world.client.send(heartbeat())
    world.client.mode(0)
    sent = world.client.command(512, 148, target=(1, 1))
    world.run(SOON)
    assert sent.result == ACCEPTED
    assert world.client.heard("AUTOPILOT_VERSION")
