"""Handing the rover back, and the orderly end of the server."""

from mav_tasks.engine.inputs import Shutdown
from mav_tasks.tasks.events import ServerStopped
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld


def shut_down(world: World) -> None:
    world.server.pump.handle(Shutdown(), now=world.now)
    world.server.turn(now=world.now)


def test_an_empty_queue_hands_the_rover_back_and_the_stream_ends(world: World) -> None:
    check(
        world,
        """
TASK_MOVE 0.5 & idle 1 : ACCEPTED
wait 4.6 : - mode hold / it is DISARMED / it STANDS / it gets nothing
""",
    )


def test_the_orderly_end_is_zero_and_hold(world: World) -> None:
    world.client.move(20, speed=1.0)
    world.client.rotate(10)
    world.run(4)
    at = world.now
    shut_down(world)
    assert world.observer.sent_since(at)[:2] == ["HOLD", "zero"]
    world.until(lambda: world.events(ServerStopped), within=3.1)
    world.run(4)
    assert world.stands()
    assert world.mode() is Mode.HOLD
    assert [world.state(k) for k in (1, 2)] == [(S.PAUSED, R.OPERATOR), (S.QUEUED, R.NONE)]


def test_a_lost_hold_is_sent_again_on_the_way_out(world: World) -> None:
    check(world, "TASK_MOVE 20 1 : ACCEPTED\nwait 3.6 & fault deaf=1 : - it MOVES")
    shut_down(world)
    check(world, "wait 0 : -\nfault : -\nwait 4.6 : - mode hold")


def test_submissions_are_refused_and_nothing_begins_on_the_way_out(world: World) -> None:
    check(world, "TASK_MOVE 5 1 : ACCEPTED\nTASK_ROTATE 10 : ACCEPTED\nwait 2.2 : -")
    shut_down(world)
    check(world, f"TASK_MOVE 1 : BUSY #{R.RATE_LIMITED}\nwait 4.6 : - task 2: QUEUED")


@for_each("persona, words", [(ARDUPILOT, ("zero", "HOLD")), (PX4, ("HOLD", "zero"))])
def test_last_words_are_there_exactly_while_a_rover_is_engaged(
    make_world: MakeWorld, persona: Persona, words: tuple[str, ...]
) -> None:
    """A zero before HOLD would end the HOLD of a PX4's failsafe."""
    world = make_world(persona=persona)
    seen: set[tuple[bool, tuple[str, ...]]] = set()
    world.watch(lambda _now: seen.add((world.control() != "IDLE", world.last_words())))
    world.client.move(0.5)
    world.until_idle(tasks=1)
    world.run(1)
    assert seen == {(True, words), (False, ())}


@for_each("persona", [ARDUPILOT, PX4])
def test_last_words_stop_a_driving_rover(make_world: MakeWorld, persona: Persona) -> None:
    world = make_world(persona=persona)
    check(world, "TASK_MOVE 20 1 : ACCEPTED\nwait 3.6 : - it MOVES")
    world.leave(world.server)
    world.server.pump.send_last_words()
    world.observer.expects_gaps = True
    check(world, "wait 4.6 : - it STANDS / mode hold")
