"""What was held before a server ended, well or not, is held by the one after it.

What had left before the halt may still come, to the new server as well as to the rover.
"""

from pathlib import Path

from mav_tasks.config.settings import Settings
from rover_sim.personas import Mode
from tests.kit.cases import anew, for_each
from tests.kit.client import ACCEPTED, HOLD, MOVE, command_long
from tests.kit.restarts import UTC, restart
from tests.kit.store import PromptSqliteStore
from tests.kit.world import World
from tests.scenarios.attacks.test_late_arming import is_arming
from tests.scenarios.attacks.test_late_to_the_rover import mend
from tests.scenarios.attacks.test_left_waiting import ELSEWHERE, RETURN, away_from_home, stays
from tests.scenarios.conftest import MakeWorld

ENDS = for_each("ends", ["well", "killed"])


@anew
def world(make_world: MakeWorld, path: Path) -> World:
    return make_world(store=PromptSqliteStore(path, wall_offset=UTC))


def end(world: World, path: Path, how: str) -> None:
    """Let the server end, or be killed, and another one start on what it has stored."""
    if how == "well":
        world.server.shut_down(now=world.now)
        world.until(lambda: world.server.pump.is_over, within=10)
    restart(world, path, well=how == "well", away=0.3, settles=0.0)


def returning(world: World) -> None:
    """Have the rover drive home by itself."""
    away_from_home(world)
    world.client.send(command_long(RETURN, target=ELSEWHERE))
    world.run(1)
    assert world.mode() is Mode.RTL


@ENDS
@for_each("halt", ["HOLD", "pause", "HOLD, then disarm"])
def test_a_halt_that_has_not_come_is_asked_for_again(
    world: World, path: Path, halt: str, ends: str
) -> None:
    person = world.add_client("person")
    returning(world)
    world.watched.loses = lambda _, target, __: target == "rover1"
    halted = person.pause() if halt == "pause" else person.mode(HOLD)
    world.run(0.5)
    if "disarm" in halt:
        person.arm(False)
        world.run(0.3)
    end(world, path, ends)
    mend(world)
    world.run(4)
    assert halted.result == ACCEPTED
    assert world.mode() is Mode.HOLD


@ENDS
@for_each("on_restart", ["pause", "continue"])
def test_an_arming_that_comes_late_after_it(
    make_world: MakeWorld, path: Path, ends: str, on_restart: str
) -> None:
    world = make_world(
        store=PromptSqliteStore(path, wall_offset=UTC), settings=Settings(on_restart=on_restart)
    )
    person = world.add_client("person")
    world.run(1)
    world.client.mode(HOLD)
    world.run(1)
    world.client.command(MOVE, 5, 0.5, 0, 0, 0, 6, 5)
    world.run(0.3)
    caught = world.overheard(lambda _source, target, data: target == "rover1" and is_arming(data))
    world.client.arm()
    world.run(0.3)
    mend(world)
    halted = person.arm(False)
    world.run(0.3)
    assert halted.result == ACCEPTED
    end(world, path, ends)
    world.run(1.2)
    world.bring_late(caught[0])
    assert stays(world, 14)


@ENDS
@for_each("halt", ["STOP", "HOLD", "pause"])
def test_a_halt_after_it_lets_no_older_continue_through(
    world: World, path: Path, halt: str, ends: str
) -> None:
    """A program repeats, unmarked, what the server before it had not answered."""
    script = world.add_client("script", system_id=245)
    person = world.add_client("person", system_id=254)
    world.run(1)
    world.client.move(20)
    world.until_faster(0.4)
    person.pause()
    world.run(3)
    script.proceed()
    world.run(0.5)
    person.pause()
    world.run(0.3)
    end(world, path, ends)
    world.run(1.0)
    halted = {"STOP": person.stop, "pause": person.pause}.get(halt, lambda: person.mode(HOLD))()
    world.run(0.5)
    late = script.proceed()
    world.run(0.1)
    assert halted.result == ACCEPTED
    assert late.result != ACCEPTED
    assert stays(world, 5)
