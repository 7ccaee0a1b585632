"""What a task waits for, and what becomes of it when the rover does not want to."""

from mav_tasks.config.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from tests.kit.cases import for_each
from tests.kit.client import HOLD
from tests.kit.rows import check
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld


def test_with_arming_by_the_operator_a_task_waits_for_it(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(arming="operator"))
    check(
        world,
        """
TASK_MOVE 0.3 & wait 3 : ACCEPTED
SHOW 1 : ACCEPTED status 1: QUEUED DISARMED / it is DISARMED
operator hold & operator arms & idle 1 : - it is ARMED
""",
    )
    assert {"arm", "disarm"}.isdisjoint(world.observer.sent_since(0))


@for_each("mode", ["auto", "rtl", "guided", "manual"])
def test_an_armed_rover_in_a_mode_that_is_not_ours_is_waited_for(world: World, mode: str) -> None:
    check(world, f"operator arms & operator {mode} & wait 1 : -")
    at = world.now
    check(
        world,
        "TASK_MOVE 0.3 : ACCEPTED\nwait 2.2 : -\nSHOW 1 : ACCEPTED status 1: QUEUED WRONG_MODE",
    )
    assert {*world.observer.sent_since(at)} <= {"511", "512"}
    check(world, "operator hold : -")
    if mode != "guided":  # in which nobody drives by hand
        check(world, "wait 2.2 : - queue TAKEOVER\nCONTINUE : ACCEPTED")
    world.until_idle(tasks=1)


@for_each("fault, reason", [("BLIND", "NO_POSITION"), ("fault silent=1", "VEHICLE_SILENT")])
def test_without_position_or_heartbeats_a_task_waits(world: World, fault: str, reason: str) -> None:
    check(
        world,
        f"""
PAUSE : ACCEPTED
TASK_MOVE 0.3 : ACCEPTED #1
{fault} & wait 5 : -
CONTINUE : ACCEPTED
SHOW 1 : ACCEPTED status 1: QUEUED {reason}
fault & idle 1 : -
""",
    )


@for_each(
    "faults, reason",
    [(Faults(refuse_arm=True), R.ARM_REFUSED), (Faults(refuse_mode=True), R.MODE_REFUSED)],
)
def test_a_refusal_fails_the_task_in_about_a_second_and_the_queue_goes_on(
    make_world: MakeWorld, faults: Faults, reason: R
) -> None:
    world = make_world(settings=Settings(watch=Watch(ready_timeout=0.0)))
    world.fault(faults)
    at = world.now
    world.client.move(0.3)
    world.run(0.05)
    world.client.rotate(10)
    world.until_state(1, S.FAILED)
    assert 0.8 < world.now - at < 1.3
    assert world.history(1) == [(S.STARTING, R.NONE), (S.FAILED, reason)]
    world.until_state(2, S.FAILED)
    assert 1.8 < world.now - at < 2.8
    assert world.history(2) == [(S.STARTING, R.NONE), (S.FAILED, reason)]
    assert world.paused() is R.NONE

    world.fault(Faults())
    world.run(3)
    world.client.move(0.3, nonce=3)
    world.until_idle(tasks=3)
    assert world.state(3)[0] is S.COMPLETED


def test_a_rover_that_answers_nothing_fails_the_task(world: World) -> None:
    """Asked four times, each on a heartbeat that shows whose it is."""
    table = "fault deaf=1 & TASK_MOVE 0.3 & until 1 FAILED within=6 : ACCEPTED task 1: FAILED MODE_"
    check(world, f"{table}REFUSED")


def test_mode_zero_arm_zeros_motion(world: World) -> None:
    at = world.now
    world.client.move(0.3)
    world.until_idle(tasks=1)
    sent = [name for name in world.observer.sent_since(at) if name not in {"511", "512"}]
    order = [name for k, name in enumerate(sent) if k == 0 or sent[k - 1] != name]
    assert order[:5] == ["GUIDED", "zero", "arm", "zero", "move"]
    assert order[-3:] == ["zero", "HOLD", "disarm"]
    assert set(order[5:-3]) <= {"move", "zero"}  # corrections of its end


def test_a_lost_answer_to_hold_delays_no_task(world: World) -> None:
    world.lose_acks()
    world.client.mode(HOLD)
    world.client.move(0.3)
    world.until(lambda: world.is_armed, within=1.0)
