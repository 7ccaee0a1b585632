"""What the net brings to a rover late, twice or in another order does not undo a halt.

The halt was acknowledged, and nobody has said a newer word. What had left before it, the server's
own words among them, may still come for some seconds; so may what a rover has said before.
"""

from struct import unpack_from

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import ARDUPILOT, Mode
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED, HOLD, FakeClient, command_long
from tests.kit.mission import Item, Upload
from tests.kit.px4 import HOLD as PX4_HOLD
from tests.kit.px4 import PROMPT_PX4, ask_mode
from tests.kit.volume import some
from tests.kit.world import World, at
from tests.scenarios.attacks.test_left_waiting import ELSEWHERE, RETURN, away_from_home, stays
from tests.scenarios.attacks.test_words_passed_on import go_to
from tests.scenarios.conftest import MakeWorld

MODE, GO_TO, CLEAR, MOVE = 176, 192, 54011, 54000
NUMBER = 38  # where the number of a command is in a packet
COMMANDS, HEARTBEAT = (75, 76), 0
WAYPOINT = 16


def is_command(data: bytes, *commands: int) -> bool:
    """Whether a packet is one of these commands."""
    return data[7] in COMMANDS and unpack_from("<H", data + bytes(40), NUMBER)[0] in commands


def catch(world: World, *commands: int) -> list[bytes]:
    """Keep commands of these numbers from the rover; they are put into the list."""
    caught: list[bytes] = []

    def loses(_source: str, target: str, data: bytes) -> bool:
        is_it = target == "rover1" and is_command(data, *commands)
        caught.extend([data] if is_it else [])
        return is_it

    world.watched.loses = loses
    return caught


def mend(world: World) -> None:
    """Let the net lose nothing any more."""
    world.watched.loses = lambda *_: False


def armed_px4(make_world: MakeWorld) -> tuple[World, FakeClient]:
    """Return an armed rover in HOLD, away from home, and a second client."""
    world = make_world(persona=PROMPT_PX4, settings=Settings(claim=False))
    person = world.add_client("person")
    world.client.move(5)
    world.until_state(1, S.COMPLETED, within=60)
    world.run(3)
    world.client.arm()
    world.run(1)
    return world, person


def test_a_px4_that_a_place_moves_in_hold_is_held_before_its_next_heartbeat(
    make_world: MakeWorld,
) -> None:
    """It holds its place by going to it, and shows HOLD all along."""
    world, person = armed_px4(make_world)
    caught = catch(world, GO_TO)
    world.client.send(go_to(20, 0))
    world.run(0.1)
    mend(world)
    held = ask_mode(person, PX4_HOLD)
    world.run(0.5)
    since = world.now
    world.fault(Faults(withheld=frozenset({HEARTBEAT})))
    world.bring_late(caught[0])
    fastest = 0.0
    while world.now < since + 2.0:
        world.run(0.05)
        fastest = max(fastest, abs(world.truth.forward_speed))
    assert held.result == ACCEPTED
    assert fastest < 0.3  # m/s; until the heartbeat it was 1.9
    world.fault(Faults())
    world.run(1)
    assert stays(world, 3)


@for_each("phase", some([0.0, 0.2, 0.4, 0.6, 0.8], 0, 3))
@for_each("late", [2.8, 3.0, 3.2, 3.4])
def test_a_mode_that_shows_only_with_the_next_heartbeat(
    make_world: MakeWorld, late: float, phase: float
) -> None:
    world = make_world(persona=ARDUPILOT)
    person = world.add_client("person")
    away_from_home(world)
    world.client.mode(HOLD)
    world.run(3 + phase)
    caught = catch(world, RETURN)
    world.client.send(command_long(RETURN, target=ELSEWHERE))
    world.run(0.05)
    mend(world)
    halted = person.mode(HOLD)
    world.run(late)
    world.bring_late(caught[0])
    world.run(6)
    assert halted.result == ACCEPTED
    assert world.mode() is Mode.HOLD


def test_our_own_mode(world: World) -> None:
    """With a set-point behind it."""
    person = world.add_client("person")
    caught = world.overheard(
        lambda _source, target, data: target == "rover1" and is_command(data, MODE)
    )
    world.client.move(10, speed=0.5)
    world.until(lambda: bool(caught) and world.is_armed, within=5)
    held = person.mode(HOLD)
    world.run(0.7)
    mend(world)
    world.bring_late(caught[0])
    world.run(2)
    assert held.result == ACCEPTED
    assert world.mode() is Mode.HOLD


@for_each("halt", ["HOLD", "everything"])
def test_a_submission_that_its_senders_halt_has_overtaken(world: World, halt: str) -> None:
    late = world.client.packed(command_long(MOVE, 3, 0, 0, 7.0, 0, 0, 5, target=(1, 191)))
    world.client.send(command_long(512, 148))  # has the next number
    halted = world.client.command(CLEAR, 1) if halt == "everything" else world.client.mode(HOLD)
    world.run(2)
    world.client.send_raw(late)
    world.run(1)
    assert halted.result == ACCEPTED
    assert world.tasks() == ()
    assert stays(world, 4)


@for_each("halt", ["HOLD", "everything"])
def test_an_upload_that_has_begun_before_a_halt(world: World, halt: str) -> None:
    held: list[int] = []
    world.watched.loses = lambda _s, target, data: (
        target == "client" and data[7] in (40, 51) and not held
    )
    items = (Item(WAYPOINT, **at(6.0, 0.0)), Item(WAYPOINT, **at(8.0, 0.0)))
    upload = Upload(world.client, items, target=(1, 191))
    world.run(0.3)
    halted = world.client.command(CLEAR, 1) if halt == "everything" else world.client.mode(HOLD)
    world.run(0.3)
    held.append(1)
    assert stays(world, 8)
    assert halted.result == ACCEPTED
    assert upload.result not in (None, 0)
