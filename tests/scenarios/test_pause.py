"""Pause and continue: zeros at once, and the same end whatever the pattern of pauses."""

from collections.abc import Callable
from dataclasses import replace

from mav_tasks.config.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import ARDUPILOT, PX4, Mode, Persona
from tests.kit.cases import for_each
from tests.kit.client import HOLD, set_mode
from tests.kit.rows import check
from tests.kit.world import OFF, World, near_pose
from tests.scenarios.conftest import MakeWorld

PAUSES: dict[str, Callable[[World], object]] = {
    "DO_PAUSE_CONTINUE": lambda w: w.client.pause(),
    "DO_PAUSE_CONTINUE to component 1": lambda w: w.client.pause(target=(1, 1)),
    "DO_SET_MODE": lambda w: w.client.mode(HOLD),
    "SET_MODE": lambda w: w.client.send(set_mode(HOLD)),
    "disarm": lambda w: w.client.arm(False),
}


@for_each("way", PAUSES)
def test_zeros_leave_at_once_and_the_rover_stands_in_hold(world: World, way: str) -> None:
    world.client.move(3)
    world.until_state(1, S.EXECUTING)
    world.client.rotate(20)
    world.run(2)
    at = world.now
    PAUSES[way](world)
    world.run(0.02)
    assert world.observer.sent_since(at)[0] == "zero"
    world.run(4)
    assert world.stands()
    assert world.mode() is Mode.HOLD
    assert world.is_armed is (way != "disarm")
    assert (world.control(), world.paused()) == ("IDLE", R.OPERATOR)
    assert [world.state(k) for k in (1, 2)] == [(S.PAUSED, R.OPERATOR), (S.QUEUED, R.NONE)]

    world.client.proceed()
    world.until_idle(tasks=2)
    assert near_pose(world.pose(), (3.0, 0.0, 20.0))


@for_each("persona", [ARDUPILOT, PX4])
def test_pausing_an_idle_armed_rover_keeps_what_is_submitted_then(
    make_world: MakeWorld, persona: Persona
) -> None:
    check(
        make_world(persona=persona),
        """
operator hold & ARM 1 & wait 1.5 : ACCEPTED it is ARMED / mode hold
PAUSE & wait 2 : ACCEPTED #0 / queue OPERATOR
TASK_MOVE 1 & wait 5 : ACCEPTED #1 / task 1: QUEUED / status 1: QUEUED QUEUE_PAUSED / at=0,0,0
CONTINUE & idle 1 : ACCEPTED task 1: COMPLETED
""",
    )


def test_neither_0_nor_1_is_denied(world: World) -> None:
    table = "".join(f"DO_PAUSE_CONTINUE {value} : DENIED #BAD\n" for value in (2, -1, "nan", "inf"))
    check(world, table.replace("BAD", f"{R.BAD_PARAMETER}"))


def test_a_pause_while_starting_resumes(world: World) -> None:
    world.client.move(1)
    world.run(0.012)
    assert world.state(1)[0] is S.STARTING
    check(
        world,
        """
PAUSE & wait 2.6 : ACCEPTED task 1: PAUSED OPERATOR / it is IDLE
CONTINUE & idle 1 : ACCEPTED at=1,0,0
""",
    )


# no ground station is heard any more


PAUSE = replace(Settings(), operator_lost="pause")


LIMIT = PAUSE.watch.operator_lost


def test_the_rover_stands_and_goes_on_only_when_told(make_world: MakeWorld) -> None:
    world = make_world(settings=PAUSE)
    world.client.move(10)
    world.client.move(1, nonce=7)
    world.until_state(1, S.EXECUTING)
    world.run(2)
    world.client.heartbeats = False
    world.run(LIMIT - 1.5)
    assert world.state(1)[0] is S.EXECUTING
    world.until_state(1, S.PAUSED, within=1.6)
    assert (world.state(1)[1], world.paused()) == (R.OPERATOR, R.OPERATOR)
    world.run(4)
    assert world.stands()

    world.client.heartbeats = True
    world.run(5)
    assert world.state(1)[0] is S.PAUSED
    assert world.client.proceed().answer is None
    world.until_idle(tasks=2)
    assert abs(world.truth.north - 11.0) < OFF


def test_a_script_without_heartbeats_is_no_operator(make_world: MakeWorld) -> None:
    world = make_world(settings=PAUSE)
    world.client.heartbeats = False
    check(world, f"wait {LIMIT + 1} : -\nTASK_MOVE 3 & idle 1 : ACCEPTED #1 / task 1: COMPLETED")
