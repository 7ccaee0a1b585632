"""Commands that stop and resume rovers: stop, pause, resume."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from itertools import takewhile
from typing import Annotated

import typer

from mav_tasks.basics.errors import ClientError, NoAnswer, Refused, UsageError
from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import is_alone, opened, unfound
from mav_tasks.cli.words import described, every_of, line_of, resume_command
from mav_tasks.client.aio import Client
from mav_tasks.client.values import TaskStatus
from mav_tasks.tasks.lifecycle import TaskReason, TaskState

LOOKED_AT = 32  # finished tasks of a rover
AT_ONCE = 2.0  # s between two tasks that one STOP has ended

Everywhere = Annotated[bool, typer.Option("--all", help="Apply to every rover of the server.")]


@command
async def stop(
    common: Common,
    everywhere: Annotated[
        bool, typer.Option("--all", help="Stop every rover, which is the default.")
    ] = False,
    clear: Annotated[bool, typer.Option("--clear", help="Also cancel the waiting tasks.")] = False,
) -> None:
    """Stop the rovers at once; no task runs until you resume.

    Stops every rover unless you give --vehicle. Here --timeout limits the wait for confirmation.
    """
    _require_one_choice(common, everywhere=everywhere)
    which, way_on = "every rover", "mav-tasks resume --all"
    if common.vehicle is not None:
        which, way_on = f"rover {common.vehicle}", f"mav-tasks resume --vehicle {common.vehicle}"
    async with unfound(common) as client:  # do not wait for discovery
        await client.stop(clear=clear, vehicle=common.vehicle, within=common.timeout)
        if not common.json:  # at once
            output.say(f"STOP is in force for {which}: no task runs until '{way_on}'")
        ended = await _ended_series(client, common.vehicle)
    if common.json:
        series = [each.series for each in ended]
        done = {"done": "stop", "vehicle": common.vehicle, "cleared": clear}
        output.say_json(done | {"ended_series": series})
    elif ended:
        output.say(_told(ended))


@command
async def pause(common: Common, everywhere: Everywhere = False) -> None:
    """Stop a rover, and pause its task and queue until you resume."""
    async with opened(common) as client:
        rovers = chosen(client, common, everywhere=everywhere)
        alone = is_alone(client, common)

        async def pause_one(rover: int) -> str:
            await client.pause(vehicle=rover)
            return f"paused. To resume: {resume_command(rover, is_alone=alone)}"

        await each_of(rovers, pause_one, common, "pause")


@command
async def resume(
    common: Common,
    everywhere: Everywhere = False,
    epoch: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Resume only if halt_epoch of 'queue --json' is still this number.",
        ),
    ] = None,
) -> None:
    """Resume tasks after a pause, a STOP or a takeover."""
    if everywhere and epoch is not None:
        raise UsageError("--epoch needs one rover: use --vehicle N instead of --all")
    async with opened(common) as client:
        rovers = chosen(client, common, everywhere=everywhere)
        alone = is_alone(client, common)

        async def resume_one(rover: int) -> str:
            paused = (await client.queue(limit=0, vehicle=rover)).paused
            await client.resume(epoch=epoch, vehicle=rover)
            if paused is TaskReason.STOPPED:
                ended = await _ended_series(client, rover)
                return f"resumed; {_told(ended)}" if ended else "resumed"
            with suppress(ClientError):  # the resume has been accepted
                first = (await client.queue(limit=0, vehicle=rover)).current
                if first is not None and first.state is TaskState.HELD:
                    line = line_of(first, is_alone=alone).removeprefix(f"rover {rover}: ")
                    return f"resumed, but blocked by {line}"
            return "resumed"

        await each_of(rovers, resume_one, common, "resume")


async def _ended_series(client: Client, rover: int | None) -> list[TaskStatus]:
    """Return the last runs of the series that the last STOP has ended; of all rovers for None."""
    ended: list[TaskStatus] = []
    with suppress(ClientError):  # the STOP, or the resume, has been accepted
        await client.found()
        for each in client.vehicles() if rover is None else [rover]:
            number = each if isinstance(each, int) else each.id
            past = await client.history(vehicle=number, limit=LOOKED_AT)
            killed = list(takewhile(lambda task: task.reason is TaskReason.STOP, past))
            ended += [
                task
                for task in killed
                if task.every is not None
                and (task.ended_ago or 0.0) - (killed[0].ended_ago or 0.0) < AT_ONCE
            ]
    return ended


def _told(ended: Sequence[TaskStatus]) -> str:
    """Return which series a STOP has ended, and what helps."""
    named = ", ".join(f"{each.series} ({described(each)}, {every_of(each)})" for each in ended)
    return f"STOP has ended the series {named}: submit again what must repeat"


def _require_one_choice(common: Common, *, everywhere: bool) -> None:
    if everywhere and common.vehicle is not None:
        raise UsageError(f"--all and --vehicle {common.vehicle}: choose one of them")


def chosen(client: Client, common: Common, *, everywhere: bool) -> list[int]:
    """Return the named rover, all rovers or the only one. Raise UsageError if ambiguous."""
    _require_one_choice(common, everywhere=everywhere)
    if common.vehicle is not None:
        return [common.vehicle]
    rovers = [each.id for each in client.vehicles()]
    if len(rovers) > 1 and not everywhere:
        ids = ", ".join(map(str, rovers))
        raise UsageError(f"the server has rovers {ids}: choose with --vehicle N or --all")
    return rovers


async def each_of(
    rovers: Sequence[int],
    ask: Callable[[int], Awaitable[str]],
    common: Common,
    action: str,
) -> None:
    """Ask all rovers at the same time, so that none waits for a silent one. Print each result.

    Raise Refused or NoAnswer if any of them failed.
    """
    answers = await asyncio.gather(*map(ask, rovers), return_exceptions=True)
    failed: list[tuple[int, ClientError]] = []
    for rover, answer in zip(rovers, answers, strict=True):
        if isinstance(answer, str):
            output.say_done(common.json, action, f"rover {rover}: {answer}", vehicle=rover)
        elif isinstance(answer, ClientError):
            failed.append((rover, answer))
        else:
            raise answer
    if len(rovers) == 1 and failed:
        raise failed[0][1]
    words = "\n".join(f"rover {rover}: {error}" for rover, error in failed)
    refused = [error for _, error in failed if isinstance(error, Refused)]
    if refused:
        raise Refused(words, result=refused[0].result, reason=refused[0].reason)
    if failed:
        raise NoAnswer(words)
