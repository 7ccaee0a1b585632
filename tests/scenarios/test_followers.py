"""Who has asked about a task is told how it goes on, whoever submitted it."""

from mav_tasks.tasks.lifecycle import TaskState as S
from tests.kit.client import FakeClient
from tests.kit.world import World


def states(client: FakeClient, task_id: int) -> list[int]:
    return [status.state for status in client.statuses(task_id)]


def test_who_has_asked_about_a_task_is_told_of_each_change(world: World) -> None:
    first = world.client.move(0.5)
    second = world.client.rotate(20.0)
    world.until(lambda: second.ack, within=2)
    other = world.add_client("other", system_id=244)
    world.run(1.5)
    assert other.statuses() == []

    other.request_status(second.task_id)
    world.until_idle(tasks=2)

    assert states(other, first.task_id) == []
    seen = list(dict.fromkeys(states(other, second.task_id)))
    assert seen == [S.QUEUED, S.EXECUTING, S.COMPLETED]
