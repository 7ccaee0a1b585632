"""An autopilot may say its mode and arming once a second and no sooner: nothing old is believed.

The last HEARTBEAT may be a second old, so what it shows can be from before our last request.
"""

from itertools import pairwise

from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import anew, for_each
from tests.kit.client import HOLD
from tests.kit.observer import GAP
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld

CANCEL = 54010


@anew
def world(make_world: MakeWorld) -> World:
    return make_world(persona=ARDUPILOT, shows_on_request=False)


@for_each("pause", [0.0, 0.1, 0.3, 0.5, 0.9, 1.3])
def test_a_task_right_after_the_last_is_no_takeover(world: World, pause: float) -> None:
    world.client.move(0.3)
    world.until(lambda: world.state(1)[0] is S.COMPLETED, within=20)
    world.run(pause)
    world.client.move(0.3)
    world.until_idle(tasks=2)
    assert world.states() == [S.COMPLETED] * 2
    assert world.events(QueuePaused) == []


def test_a_rover_that_is_handed_back_is_kept_standing_for_the_next_task(
    make_world: MakeWorld,
) -> None:
    world = make_world(persona=PX4, shows_on_request=False)
    world.client.move(0.3)
    world.until_state(1, S.COMPLETED)
    begun = world.now
    world.client.move(0.3)
    world.until(lambda: world.control() == "ASKING_HOLD", within=1.2)
    zeros = [at for at, _ in world.observer.driven if at > begun]
    assert max(later - at for at, later in pairwise([begun, *zeros, world.now])) < GAP


@for_each("after", [0.1, 0.3, 0.5, 1.3])
@for_each("how", ["pause", "hold"])
def test_continue_soon_after_a_pause_goes_on_to_the_same_end(
    world: World, how: str, after: float
) -> None:
    world.client.move(1.5)
    world.until_state(1, S.EXECUTING)
    world.run(1.0)
    if how == "pause":
        world.client.pause()
    else:
        world.client.command(176, 1, HOLD, target=(1, 1))
    world.run(after)
    world.client.proceed()
    world.until_idle(tasks=1)
    assert near_pose(world.pose(), (1.5, 0.0, 0.0))
    assert [e.reason for e in world.events(QueuePaused)] == [R.OPERATOR]


@for_each("after", [0.1, 0.3, 0.5, 1.5])
def test_continue_soon_after_stop_lets_the_next_task_run(world: World, after: float) -> None:
    world.client.move(20)
    world.until_state(1, S.EXECUTING)
    waiting = world.client.move(0.3)
    world.run(1.0)
    world.client.stop()
    world.run(after)
    world.client.proceed()
    world.until_idle(tasks=2)
    assert waiting.task_id == 2
    assert world.states() == [S.KILLED, S.COMPLETED]


@for_each("who", ["client", "operator"])
def test_a_rover_disarmed_while_driving_does_not_drive_off_when_armed_again(
    world: World, who: str
) -> None:
    world.client.move(20, speed=1.0)
    world.until_state(1, S.EXECUTING)
    world.run(3.0)
    if who == "client":
        assert world.client.command(400, 0, target=(1, 1)).message.command == 400
    else:
        world.operator_arm(False)
    world.until(world.stands, within=6)
    where = world.pose()
    world.operator_arm(True)
    world.run(4.0)
    assert near_pose(world.pose(), where)
    assert world.state(1) == (S.PAUSED, R.OPERATOR if who == "client" else R.TAKEOVER)


@for_each("persona", [ARDUPILOT, PX4])
@for_each("after", [0.0, 0.05, 0.2, 0.6])
def test_what_was_armed_and_not_seen_yet_when_it_is_cancelled_is_disarmed(
    make_world: MakeWorld, persona: Persona, after: float
) -> None:
    world = make_world(persona=persona, shows_on_request=False)
    world.client.move(2.0)
    world.until(lambda: world.is_armed, within=10)
    world.run(after)
    world.client.command(CANCEL, 1)
    world.until(lambda: world.control() == "IDLE", within=10)
    world.run(1.5)
    assert (world.is_armed, world.mode()) == (False, Mode.HOLD)
    world.client.move(0.5)
    world.until_idle(tasks=2)
    assert world.state(2)[0] is S.COMPLETED
