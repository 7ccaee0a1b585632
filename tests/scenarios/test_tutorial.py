"""The tutorial's three tasks, from submission to the last standstill."""

from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.world import World, near_pose


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
    assert near_pose(world.pose(), (2.0, 1.5, 90.0))
