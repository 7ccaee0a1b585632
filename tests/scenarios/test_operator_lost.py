"""No ground station is heard any more: a setting says whether tasks go on unseen."""

from dataclasses import replace

from mav_tasks.settings import Settings
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.client import ACCEPTED
from tests.scenarios.conftest import MakeWorld

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
    assert abs(world.truth.north - 11.0) < 0.04


def test_a_script_without_heartbeats_is_no_operator(make_world: MakeWorld) -> None:
    world = make_world(settings=PAUSE)
    world.client.heartbeats = False
    world.run(LIMIT + 1)
    sent = world.client.move(3)
    world.until_idle(tasks=1)
    assert (sent.answer, world.state(1)[0]) == ((ACCEPTED, 1), S.COMPLETED)


@for_each("settings", [Settings(), PAUSE])
def test_what_waits_waits_only_by_that_setting(make_world: MakeWorld, settings: Settings) -> None:
    world = make_world(settings=settings)
    world.client.command(54000, 1.0, 0, 0, 0, 0, LIMIT + 3, 5)
    world.run(0.5)
    world.client.heartbeats = False
    world.run(LIMIT + 10)
    if settings is PAUSE:
        assert (world.state(1)[0], world.paused()) == (S.QUEUED, R.OPERATOR)
    else:
        assert world.state(1)[0] is S.COMPLETED
