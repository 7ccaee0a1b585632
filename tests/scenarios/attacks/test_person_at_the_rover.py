"""A person at the rover, whose hand the server sees late, or takes for its own doing."""

from mav_tasks.config.settings import Settings
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED
from tests.kit.px4 import PROMPT_PX4
from tests.kit.world import PROMPT, World
from tests.scenarios.attacks.test_late_to_the_rover import mend
from tests.scenarios.attacks.test_left_waiting import stays
from tests.scenarios.attacks.test_words_passed_on import go_to
from tests.scenarios.conftest import MakeWorld

CANCEL = 54010
MAKES = [PROMPT, ARDUPILOT, PROMPT_PX4, PX4]
BOTH = [True, False]


def driving(world: World, distance: float = 20.0) -> None:
    """Let a task drive for a while."""
    world.client.move(distance, speed=0.5)
    world.until_faster(0.45)
    world.run(2)


@for_each("persona", MAKES)
@for_each("both_ways", BOTH)
@for_each("seconds", [1.3, 1.6, 2.2])
@for_each("phase", [0.0, 0.25, 0.5, 0.75])
def test_who_takes_it_during_a_short_gap_keeps_it(
    make_world: MakeWorld, persona: Persona, seconds: float, both_ways: bool, phase: float
) -> None:
    """Nobody parks it: the switch stays where it is, and our HOLD must not turn it."""
    world = make_world(persona=persona)
    world.run(phase)
    driving(world)
    world.watched.loses = lambda source, target, _: (
        source == "rover1" or (both_ways and target == "rover1")
    )
    world.run(0.2)
    world.operator_mode(Mode.MANUAL)
    world.run(seconds)
    mend(world)
    world.run(8)
    assert world.mode() is Mode.MANUAL
    assert abs(world.truth.forward_speed) < 0.05


@for_each("persona", MAKES)
@for_each("shows_on_request", BOTH)
@for_each("word", ["a task", "a continue", "the next task"])
@for_each("phase", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_who_takes_it_just_before_we_do_keeps_it(
    make_world: MakeWorld, persona: Persona, shows_on_request: bool, word: str, phase: float
) -> None:
    """The last heartbeat may be a second old: it does not show whose the rover is now."""
    world = make_world(persona=persona, shows_on_request=shows_on_request)
    if word != "a task":
        driving(world)
        if word == "a continue":
            world.client.pause()
        else:
            world.client.command(CANCEL, 1)
    world.run(6 + phase)
    world.operator_mode(Mode.MANUAL)
    world.operator_arm(True)
    world.run(0.05)
    if word == "a continue":
        world.client.proceed()
    else:
        world.client.move(2.0)
    assert stays(world, 6)
    assert world.mode() is Mode.MANUAL


@for_each("persona", [PX4, PROMPT_PX4])
@for_each("word", ["a task", "a continue"])
@for_each("after", [0.25, 0.45, 0.65, 0.85, 1.05])
@for_each("phase", [0.0, 0.35, 0.7])
def test_who_takes_it_while_zeros_lead_in_keeps_it(
    make_world: MakeWorld, persona: Persona, word: str, after: float, phase: float
) -> None:
    """A second passes between the heartbeat that shows it armed and the request for our mode."""
    world = make_world(persona=persona)
    if word == "a continue":
        driving(world)
        world.client.pause()
    world.run(6 + phase)
    if word == "a continue":
        world.client.proceed()
    else:
        world.client.move(3.0)
    world.run(after)
    world.operator_mode(Mode.MANUAL)
    assert stays(world, 6)
    assert world.mode() is Mode.MANUAL


@for_each("persona", [PROMPT_PX4, PX4])
@for_each("shows_on_request", BOTH)
@for_each("halt", ["pause", "cancel"])
@for_each("after", [0.02, 0.1, 0.3, 0.6])
def test_a_halt_while_it_is_being_taken_stops_its_way_to_a_place(
    make_world: MakeWorld, persona: Persona, shows_on_request: bool, halt: str, after: float
) -> None:
    """In HOLD a PX4 drives to where a client has sent it, whatever zeros it hears."""
    settings = Settings(claim=False)
    world = make_world(persona=persona, shows_on_request=shows_on_request, settings=settings)
    person = world.add_client("person")
    world.client.move(5)
    world.until_idle(tasks=1)
    world.run(3)
    world.client.arm()
    world.run(1)
    world.client.send(go_to(60, 0))
    world.run(4.5)
    speed = world.truth.forward_speed
    world.client.move(3)
    world.run(after)
    said = person.pause() if halt == "pause" else person.command(CANCEL, 2)
    north = world.truth.north
    world.run(12)
    assert speed > 1.5
    assert said.result == ACCEPTED
    assert world.truth.north - north < 20  # by STOP, too, 14 to 18 m
    assert abs(world.truth.forward_speed) < 0.05
