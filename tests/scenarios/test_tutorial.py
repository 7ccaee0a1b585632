"""The tutorial's three tasks, from submission to the last standstill."""

from mav_tasks.tasks.events import TaskChanged
from mav_tasks.tasks.lifecycle import TaskState
from tests.kit.world import World


def test_the_first_starts_at_once_and_then_the_more_urgent_runs_first() -> None:
    world = World().ready()
    sent = [world.client.move(2.0, priority=3)]
    world.run(0.1)
    sent += [world.client.rotate(90, priority=8), world.client.move(1.5, priority=5)]
    assert world.run_until(lambda: world.is_idle(tasks=3), within=60)

    assert [s.ack.result_param2 for s in sent if s.ack] == [1, 2, 3]
    assert [(e.task_id, e.new) for e in world.events(TaskChanged)] == [
        (task_id, state)
        for task_id in (1, 2, 3)
        for state in (TaskState.STARTING, TaskState.EXECUTING, TaskState.COMPLETED)
    ]
    world.check()
