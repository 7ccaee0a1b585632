"""Handing the rover back, and the orderly end of the server."""

from mav_tasks.engine.inputs import Shutdown
from mav_tasks.tasks.events import ServerStopped
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import TEMPORARILY_REJECTED
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld


def shut_down(world: World) -> None:
    world.server.pump.handle(Shutdown(), now=world.now)
    world.server.turn(now=world.now)


def test_an_empty_queue_hands_the_rover_back_and_the_stream_ends(world: World) -> None:
    world.client.move(0.5)
    world.until_idle(tasks=1)
    at = world.now
    world.run(5)
    assert (world.mode(), world.is_armed) == (Mode.HOLD, False)
    assert world.stands()
    assert world.observer.sent_since(at) == []


@for_each("after", [k * 0.003 for k in range(0, 14, 3)])
def test_the_next_task_right_after_the_hand_back_works(world: World, after: float) -> None:
    """Submitted while HOLD, disarming, or what follows is on its way, in steps of 3 ms."""
    world.client.move(0.3)
    world.until(lambda: world.control() == "RELEASING", within=10)
    world.run(after)
    world.client.move(0.3, nonce=2)
    world.until_idle(tasks=2)
    assert world.states() == [S.COMPLETED, S.COMPLETED]
    assert not world.is_armed


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
    world.client.move(20, speed=1.0)
    world.run(4)
    world.fault(Faults(deaf=True))
    shut_down(world)
    world.run(0.4)
    world.fault(Faults())
    world.run(5)
    assert world.mode() is Mode.HOLD


def test_submissions_are_refused_and_nothing_begins_on_the_way_out(world: World) -> None:
    world.client.move(5, speed=1.0)
    world.client.rotate(10)
    world.run(3)
    shut_down(world)
    refused = world.client.move(1, nonce=4)
    world.run(0.5)
    assert refused.answer == (TEMPORARILY_REJECTED, R.RATE_LIMITED)
    world.run(5)
    assert world.state(2)[0] is S.QUEUED


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
    world.client.move(20, speed=1.0)
    world.run(4)
    world.leave(world.server)
    world.server.pump.send_last_words()
    world.observer.expects_gaps = True
    world.run(5)
    assert world.stands()
    assert world.mode() is Mode.HOLD


def test_a_server_that_vanishes_leaves_a_rover_that_stops_by_itself(world: World) -> None:
    world.client.move(20, speed=1.0)
    world.run(4)
    world.leave(world.server)
    north = world.truth.north
    world.until(world.stands, within=3.0 + 2.0)  # its time-out, and braking
    assert world.truth.north - north < 1.0 * 3.0 + 1.0
    where = world.pose()
    world.run(5)
    assert near_pose(world.pose(), where, metres=0.01)
