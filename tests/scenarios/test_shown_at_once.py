"""What a client has changed it sees in a heartbeat at once, not at the rover's next second."""

from dataclasses import replace
from typing import Any

from rover_sim.commands import CommandParts, CommandTable
from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, heartbeat, set_mode
from tests.kit.world import World, asks_for_heartbeat
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


@for_each("persona", [PX4, GENERIC])
def test_a_mode_that_is_set_by_message(make_world: MakeWorld, persona: Persona) -> None:
    world = away_from_a_beat(make_world(persona=persona))
    for mode in (Mode.MANUAL, Mode.HOLD):
        number = persona.modes.numbers[mode]
        world.client.send(set_mode(number))
        world.run(SOON)
        assert shown(world).custom_mode == number


def refusing(persona: Persona) -> Persona:
    """A make that sends no heartbeat on request."""

    def commands(parts: CommandParts) -> CommandTable:
        def send_now(message_id: int, now: float) -> bool:
            return message_id != 0 and parts.send_now(message_id, now)

        return persona.commands(replace(parts, send_now=send_now))

    return replace(persona, commands=commands)


@for_each("refuses", [True, False])
def test_one_that_shows_nothing_on_request_is_not_asked_for_ever(
    make_world: MakeWorld, refuses: bool
) -> None:
    world = make_world(persona=refusing(ARDUPILOT) if refuses else ARDUPILOT)
    asked: list[float] = []

    def watch(source: str, target: str, data: bytes) -> bool:
        is_request = target == "rover1" and asks_for_heartbeat(data)
        if is_request:
            asked.append(world.now)
        return is_request and not refuses

    world.watched.loses = watch
    for _ in range(4):
        for mode in (Mode.MANUAL, Mode.HOLD):
            world.client.mode(ARDUPILOT.modes.numbers[mode])
            world.run(1.5)
            assert shown(world).custom_mode == ARDUPILOT.modes.numbers[mode]
    assert len(asked) == (1 if refuses else 3)


def test_a_question_of_a_client_is_answered_beside_ours(make_world: MakeWorld) -> None:
    world = away_from_a_beat(make_world(persona=ARDUPILOT))
    world.client.send(heartbeat())
    world.client.mode(0)
    sent = world.client.command(512, 148, target=(1, 1))
    world.run(SOON)
    assert sent.result == ACCEPTED
    assert world.client.heard("AUTOPILOT_VERSION")
