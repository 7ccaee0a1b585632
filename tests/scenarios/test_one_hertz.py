"""An autopilot may say its mode and arming once a second and no sooner: nothing old is believed.

The last HEARTBEAT may be a second old, so what it shows can be from before our last request.
"""

from itertools import pairwise

from mav_tasks.tasks.events import QueuePaused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import anew, for_each
from tests.kit.observer import GAP
from tests.kit.rows import ask, check
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld

CANCEL = 54010


@anew
def world(make_world: MakeWorld) -> World:
    return make_world(persona=ARDUPILOT, shows_on_request=False)


@for_each("pause", [0.0, 0.1, 0.3, 0.5, 0.9, 1.3])
def test_a_task_right_after_the_last_is_no_takeover(world: World, pause: float) -> None:
    check(
        world,
        f"""
TASK_MOVE 0.3 & until 1 COMPLETED : ACCEPTED
wait {pause} & TASK_MOVE 0.3 0 0 2 & idle 2 : ACCEPTED task 1: COMPLETED / task 2: COMPLETED
""",
    )
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
@for_each("halt", ["PAUSE", "DO_SET_MODE 1 4 to=autopilot"])
def test_continue_soon_after_a_pause_goes_on_to_the_same_end(
    world: World, halt: str, after: float
) -> None:
    check(
        world,
        f"""
TASK_MOVE 1.5 & until 1 EXECUTING : ACCEPTED
wait 1 : -
{halt} & wait {after} & CONTINUE & idle 1 : ACCEPTED+ACCEPTED at=1.5,0,0
""",
    )
    assert [e.reason for e in world.events(QueuePaused)] == [R.OPERATOR]


@for_each("after", [0.1, 0.3, 0.5, 1.5])
def test_continue_soon_after_stop_lets_the_next_task_run(world: World, after: float) -> None:
    check(
        world,
        f"""
TASK_MOVE 20 & until 1 EXECUTING : ACCEPTED
TASK_MOVE 0.3 & wait 1 : ACCEPTED #2
TASK_STOP & wait {after} & CONTINUE & idle 2 : ACCEPTED+ACCEPTED \
task 1: KILLED / task 2: COMPLETED
""",
    )


@for_each(
    "who, reason",
    [("COMPONENT_ARM_DISARM 0 to=autopilot", R.OPERATOR), ("operator disarms", R.TAKEOVER)],
)
def test_a_rover_disarmed_while_driving_does_not_drive_off_when_armed_again(
    world: World, who: str, reason: R
) -> None:
    check(world, "TASK_MOVE 20 1 & until 1 EXECUTING : ACCEPTED\nwait 3 : -")
    ask(world, who)
    world.until(world.stands, within=6)
    where = world.pose()
    check(world, f"operator arms & wait 4 : - task 1: PAUSED {reason.name}")
    assert near_pose(world.pose(), where)


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
