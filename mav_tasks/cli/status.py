"""``mav-tasks status``: show one task."""

from datetime import datetime

from mav_tasks.basics.errors import Refused
from mav_tasks.cli import output, words
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common, TaskId, Wait
from mav_tasks.cli.session import find_task, is_alone, opened
from mav_tasks.cli.times import moment_ago, spoken_duration
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import end_of, state_of, what_of
from mav_tasks.client.handle import Task
from mav_tasks.client.json_form import task_json, timing_json
from mav_tasks.client.values import TaskStatus, TaskTiming
from mav_tasks.mavlink.address import who_is


@command
async def status(task_id: TaskId, common: Common, wait: Wait = False) -> None:
    """Show a task, and what to do if it waits for you."""
    async with opened(common) as client:
        task = await find_task(client, common, task_id)
        if wait:
            from mav_tasks.cli.follow import follow  # noqa: PLC0415

            await follow(client, task, common)
            return
        answer, timing = await task.refresh(), await _timing_of(task)
        if common.json:
            output.say_json(task_json(answer) | {"setpoints": timing_json(timing)})
            return
        ages = {each.id: each.heartbeat_age for each in client.vehicles()}
        silence = words.silence_of(ages.get(answer.vehicle))
        to_do = await _to_do(client, common, answer)
        for name, value in _fields(answer, timing, silence, to_do):
            if value:
                output.say(f"{name:<14}{value}")


async def _to_do(client: Client, common: Common, status: TaskStatus) -> str:
    """Return what a person can do so that the task runs; "" if nothing."""
    alone = is_alone(client, common)
    if words.starts_by_itself(status):
        return words.way_on_of(status, is_alone=alone)
    queue = await client.queue(vehicle=status.vehicle, limit=0)
    return words.obstacle_of(status, queue, is_alone=alone)[1]


async def _timing_of(task: Task) -> TaskTiming | None:
    try:
        return await task.timing()
    except Refused:  # an older server does not support the request
        return None


def _fields(
    status: TaskStatus, timing: TaskTiming | None, silence: str, to_do: str
) -> list[tuple[str, str]]:
    ahead = "" if not status.is_waiting or status.position is None else str(status.position)
    return [
        ("task", str(status.id)),
        ("rover", f"{status.vehicle} ({silence})" if silence else str(status.vehicle)),
        ("label", status.label),
        ("goal", what_of(status)),
        ("state", state_of(status)),
        ("reason", end_of(status)),
        ("what to do", to_do),
        ("priority", str(status.priority)),
        ("after task", str(status.after or "")),
        ("tasks ahead", ahead),
        ("progress", words.percent_of(status)),
        ("remaining", words.left_of(status)),
        ("item", f"{status.item} of {status.items}" if status.items > 1 else ""),
        ("starts in", words.starts_of(status)),
        ("repeats", words.every_of(status)),
        ("series", str(status.series or "")),
        ("ends in", words.ends_of(status)),
        ("run time", words.took_of(status)),
        ("ended", _ended(status)),
        ("setpoints", words.timing_of(timing)),
        ("submitted by", f"{who_is(status.submitter)} ({status.submitter})"),
    ]


def _ended(status: TaskStatus) -> str:
    if status.ended_ago is None:
        return ""
    now = datetime.now().astimezone()
    return (
        f"{moment_ago(status.ended_ago, now=now)} {now:%Z}, {spoken_duration(status.ended_ago)} ago"
    )
