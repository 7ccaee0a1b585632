"""``mav-tasks queue``: show the running and the waiting tasks."""

from typing import Annotated

import typer

from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import is_alone, opened, queues_of
from mav_tasks.client.json_form import queue_json
from mav_tasks.client.values import QueueStatus


@command
async def queue(
    common: Common,
    watch: Annotated[
        bool, typer.Option("--watch", help="Update the display until Ctrl-C.")
    ] = False,
    limit: Annotated[
        int,
        typer.Option(
            min=1, metavar="NUMBER", help="Show at most this many waiting tasks per rover."
        ),
    ] = 100,
) -> None:
    """Show the running and the waiting tasks, and why they wait.

    Shows the queues of all rovers unless you give --vehicle.
    """
    async with opened(common) as client:
        if watch:
            from mav_tasks.cli.watch import watch_queues  # noqa: PLC0415

            await watch_queues(client, common, show, limit=limit)
            return
        queues = await queues_of(client, common, limit=limit)
        show(queues, common, is_alone=is_alone(client, common))


def show(queues: list[QueueStatus], common: Common, *, is_alone: bool) -> None:
    if common.json:
        for each in queues:
            output.say_json(queue_json(each))
        return
    from mav_tasks.cli.tables import queue_table  # noqa: PLC0415

    width = output.console().width
    for each in queues:
        output.show(queue_table(each, width=width, is_alone=is_alone))
