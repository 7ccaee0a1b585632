"""Commands on existing tasks: cancel, clear, modify, release."""

import sys
from typing import Annotated, get_args

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.lazy import completing
from mav_tasks.cli.options import Common, TaskId
from mav_tasks.cli.session import find_task, opened, values_checked
from mav_tasks.cli.terms import ChangedTerms
from mav_tasks.cli.typed_words import in_typed_words
from mav_tasks.client.aio import Client
from mav_tasks.client.descriptions import state_of
from mav_tasks.client.handle import Release

RELEASED = {
    "again": "released, restarts from here",
    "remainder": "released, finishes the remainder",
    "skip": "skipped",
}


@command
async def cancel(
    common: Common,
    task_id: Annotated[
        int | None,
        typer.Argument(metavar="[ID]", min=1, help="Id of the task; default: the running task."),
    ] = None,
    kill: Annotated[
        bool, typer.Option("--kill", help="Also put the rover into HOLD at once.")
    ] = False,
    series: Annotated[
        bool,
        typer.Option(
            "--series", help="Cancel the series of this run: it does not repeat any more."
        ),
    ] = False,
) -> None:
    """Cancel a task.

    If it repeats, its next run stays planned unless you give --series (or --kill).
    """
    if series and kill:
        raise UsageError("--kill ends the series, too: leave out --series")
    async with opened(common) as client:
        if series:
            rover = await _rover_of(client, common, task_id)
            task_id = await client.cancel(task_id, series=True, vehicle=rover)
        elif task_id is not None:
            task = await find_task(client, common, task_id)
            rover = task.vehicle
            await (task.kill() if kill else task.cancel())
        else:
            rover = client.vehicle
            task_id = await (client.kill() if kill else client.cancel())
        status = await client.status(task_id, vehicle=rover)
    words = f"rover {rover}: task {task_id} {'killed' if kill else 'cancelled'}"
    if series:
        words += ", and its series"
    elif status.every is not None and not kill:
        words += f"; it repeats; to end its series: mav-tasks cancel --series {task_id}"
    output.say_done(common.json, "kill" if kill else "cancel", words, task=task_id, vehicle=rover)


async def _rover_of(client: Client, common: Common, task_id: int | None) -> int:
    """Return the rover of a series, which may be named by a run that is long over."""
    if task_id is None or common.vehicle is not None or len(client.vehicles()) == 1:
        return client.vehicle
    return (await find_task(client, common, task_id)).vehicle


@command
async def clear(
    common: Common,
    everything: Annotated[
        bool,
        typer.Option("--all", help="Also cancel the tasks that have begun: running, paused, held."),
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask for confirmation.")] = False,
) -> None:
    """Cancel all waiting tasks of a rover."""
    if everything and not yes:
        _confirm("Cancel all tasks, also those that have begun?")
    async with opened(common) as client:
        rover = client.vehicle
        await client.clear(running_too=everything)
        left = None if everything else (await client.queue(limit=0)).current
    which = "all tasks" if everything else "all waiting tasks"
    words = f"rover {rover}: {which} cancelled"
    if left is not None:
        words += f"; task {left.id} stays ({state_of(left)}); to cancel it: mav-tasks clear --all"
    output.say_done(
        common.json,
        "clear",
        words,
        running_too=everything,
        vehicle=rover,
        left=None if left is None else left.id,
    )


@command
async def modify(task_id: TaskId, terms: ChangedTerms, common: Common) -> None:
    """Change a task that has not ended.

    Options that you omit leave the task unchanged.
    """
    changes = terms.read()
    if not changes:
        raise UsageError(f"modify {task_id}: nothing to change; give --priority or another option")
    async with opened(common) as client:
        task = await find_task(client, common, task_id)
        with values_checked(), in_typed_words():
            await task.modify(**changes)
    words = f"rover {task.vehicle}: task {task_id} changed"
    output.say_done(common.json, "modify", words, task=task_id, vehicle=task.vehicle)


@command
async def release(
    common: Common,
    wish: Annotated[
        list[str],
        typer.Argument(
            metavar="[ID] again|remainder|skip",
            autocompletion=completing("mav_tasks.cli.control:RELEASED"),
            help="Id of the task (default: the held task), then what to do with it.",
        ),
    ],
) -> None:
    """Restart, finish or skip a held task.

    "again" restarts the task here, "remainder" finishes it, "skip" drops it.
    """
    *named, how = wish
    choices: tuple[Release, ...] = get_args(Release)
    if how not in choices or len(named) > 1:
        raise UsageError(f"release {' '.join(wish)}: expected [ID] again, remainder or skip")
    if named and not (named[0].isascii() and named[0].isdigit()):
        raise UsageError(f"release {named[0]}: expected the id of a task")
    chosen = choices[choices.index(how)]
    async with opened(common) as client:
        if named:
            task = await find_task(client, common, int(named[0]))
            await task.release(chosen)
            task_id, rover = task.id, task.vehicle
        else:
            rover = client.vehicle
            task_id = await client.release(None, chosen)
    words = f"rover {rover}: task {task_id}: {RELEASED[chosen]}"
    output.say_done(common.json, "release", words, task=task_id, how=how, vehicle=rover)


def _confirm(question: str) -> None:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("--all also cancels tasks that have begun: add --yes")
    if not typer.confirm(question):
        raise UsageError("nothing was cancelled")
