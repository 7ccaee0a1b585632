"""The tutorial's three tasks, from submission to the last standstill."""

from mav_tasks.links.memory import Conditions
from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.cases import for_each
from tests.kit.volume import tries
from tests.kit.world import World, near_pose
from tests.scenarios.conftest import MakeWorld

PATIENT = tuple(k * 0.5 for k in range(10))  # s, when a command is sent until it is acknowledged
BAD_NET = Conditions(delay=0.005, jitter=0.1, loss=0.1, duplication=0.05)


def test_the_first_starts_at_once_and_then_the_more_urgent_runs_first(world: World) -> None:
    sent = [world.client.move(2.0, priority=3)]
    world.run(0.1)
    sent += [world.client.rotate(90, priority=8), world.client.move(1.5, priority=5)]
    world.until_idle(tasks=3)

    assert [s.task_id for s in sent] == [1, 2, 3]
    assert [(e.task_id, e.new) for e in world.events(TaskChanged)] == [
        (task_id, state)
        for task_id in (1, 2, 3)
        for state in (S.STARTING, S.EXECUTING, S.COMPLETED)
    ]
    assert near_pose(world.pose(), (2.0, 1.5, 90.0), metres=0.04)


def test_of_those_that_wait_a_later_one_overtakes_if_it_is_more_urgent(world: World) -> None:
    world.client.move(0.5, priority=3)
    world.run(0.1)
    world.client.move(-0.5, priority=5)
    world.client.rotate(90, priority=8)
    world.until_idle(tasks=3)

    finished = [e.task_id for e in world.events(TaskChanged) if e.new is S.COMPLETED]
    assert finished == [1, 3, 2]


@for_each("seed", range(tries(4, long=100)))
def test_all_of_it_is_done_in_order_over_a_bad_net(make_world: MakeWorld, seed: int) -> None:
    world = make_world(seed=seed, conditions=BAD_NET)
    first = world.client.move(0.6, priority=3, repeats=PATIENT, nonce=1)
    world.until(lambda: first.ack, within=6)
    world.run(0.3)  # an ack of the first, doubled by the net, must not be taken for the third's
    world.client.rotate(45, priority=8, repeats=PATIENT, nonce=2)
    world.client.move(-0.4, priority=5, repeats=PATIENT, nonce=3)
    world.until_idle(tasks=3)

    finished = [e for e in world.events(TaskChanged) if e.new is S.COMPLETED]
    by_priority = {t.id: t.priority for t in world.tasks()}
    assert [by_priority[e.task_id] for e in finished] == [3, 8, 5]
