"""What a task waits for, and what becomes of it when the rover does not want to."""

from mav_tasks.config.settings import Settings, Watch
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.faults import Faults
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import HOLD
from tests.kit.world import World
from tests.scenarios.conftest import MakeWorld

POSITION = 32


def test_with_arming_by_the_operator_a_task_waits_for_it(make_world: MakeWorld) -> None:
    world = make_world(settings=Settings(arming="operator"))
    world.client.move(0.3)
    world.run(3)
    assert world.shown(1).why == (S.QUEUED, R.DISARMED)
    world.operator_mode(Mode.HOLD)
    world.operator_arm(True)
    world.until_idle(tasks=1)
    sent = world.observer.sent_since(0)
    assert "arm" not in sent
    assert "disarm" not in sent
    assert world.is_armed


@for_each("mode", [Mode.AUTO, Mode.RTL, Mode.GUIDED, Mode.MANUAL])
def test_an_armed_rover_in_a_mode_that_is_not_ours_is_waited_for(world: World, mode: Mode) -> None:
    world.operator_arm(True)
    world.operator_mode(mode)
    world.run(1)
    at = world.now
    world.client.move(0.3)
    world.run(3)
    assert world.shown(1).why == (S.QUEUED, R.WRONG_MODE)
    assert [name for name in world.observer.sent_since(at) if name not in {"511", "512"}] == []
    world.operator_mode(Mode.HOLD)
    if mode is not Mode.GUIDED:  # in which nobody drives by hand
        world.run(3)
        assert world.paused() is R.TAKEOVER
        world.client.proceed()
    world.until_idle(tasks=1)


def test_without_position_a_task_waits(world: World) -> None:
    world.fault(Faults(withheld=frozenset({POSITION})))
    world.run(1)
    world.client.move(0.3)
    world.run(2)
    assert world.shown(1).why == (S.QUEUED, R.NO_POSITION)
    world.fault(Faults())
    world.until_idle(tasks=1)


def test_for_a_silent_rover_a_task_waits(world: World) -> None:
    world.client.pause()
    world.run(0.1)
    world.client.move(0.3)
    world.run(0.1)
    world.fault(Faults(silent=True))
    world.run(5)
    world.client.proceed()
    world.run(0.1)
    assert world.shown(1).why == (S.QUEUED, R.VEHICLE_SILENT)
    world.fault(Faults())
    world.until_idle(tasks=1)


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
    world.fault(Faults(deaf=True))
    at = world.now
    world.client.move(0.3)
    world.until_state(1, S.FAILED)
    assert world.now - at < 6.0  # four times, each on a heartbeat that shows whose it is
    assert world.state(1)[1] is R.MODE_REFUSED


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
