"""``mav-tasks history``: list the finished tasks."""

from datetime import datetime
from typing import Annotated

import typer

from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import opened
from mav_tasks.client.json_form import task_json
from mav_tasks.client.values import TaskStatus


@command
async def history(
    common: Common,
    limit: Annotated[
        int, typer.Option(min=1, metavar="NUMBER", help="Show at most this many tasks per rover.")
    ] = 20,
) -> None:
    """List finished tasks, newest first.

    Lists the tasks of all rovers unless you give --vehicle; times are local. 'mav-tasks log' prints
    all events.
    """
    async with opened(common) as client:
        rovers = [each.id for each in client.vehicles() if common.vehicle in (None, each.id)]
        found = {rover: await client.history(vehicle=rover, limit=limit) for rover in rovers}
    for rover, tasks in found.items():
        _show(rover, tasks, as_json=common.json)


def _show(rover: int, tasks: tuple[TaskStatus, ...], *, as_json: bool) -> None:
    if as_json:
        for each in tasks:
            output.say_json(task_json(each))
        return
    from mav_tasks.cli.tables import history_table  # noqa: PLC0415

    output.say(f"rover {rover}: {_headline(len(tasks))}")
    if tasks:
        now = datetime.now().astimezone()
        output.show(history_table(tasks, now=now, width=output.console().width))


def _headline(count: int) -> str:
    if not count:
        return "no finished task"
    return "the last finished task" if count == 1 else f"the last {count} finished tasks"
