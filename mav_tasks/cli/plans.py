"""``mav-tasks mission``, ``fence`` and ``rally``: upload and download plan files."""

import sys
from collections.abc import Sized
from pathlib import Path
from typing import Annotated

import typer

from mav_tasks.basics.errors import Refused, UsageError
from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.lazy import group
from mav_tasks.cli.options import AnyCommon, Common, TaskOptions, Wait
from mav_tasks.cli.session import ChoiceHeard, opened, rover_of, values_checked
from mav_tasks.cli.submit import tell_submitted
from mav_tasks.cli.terms import NewTerms
from mav_tasks.plans import PlanFile, format_plan, read_plan, write_plan
from mav_tasks.tasks.task import ANY

STANDARD_OUTPUT = "-"
NOTHING = PlanFile((), None, (), ())

FileIn = Annotated[
    Path, typer.Argument(metavar="FILE", help="Mission file: .plan or QGC WPL 110 (.waypoints).")
]
PlanIn = Annotated[Path, typer.Argument(metavar="FILE", help="QGroundControl .plan file.")]
FileOut = Annotated[
    str,
    typer.Argument(
        metavar="FILE",
        help="Output file: .plan, or .waypoints for QGC WPL 110; '-': standard output.",
    ),
]
PlanOut = Annotated[
    str, typer.Argument(metavar="FILE", help="Output file: .plan; '-': standard output.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
mission = group("Upload, start and download missions.")
fence = group("Upload, download and clear the fence.")
rally = group("Upload and clear rally points.")


@mission.command("upload")
@command
async def upload_mission(
    file: FileIn,
    terms: NewTerms,
    options: TaskOptions,
    common: AnyCommon,
    stage: Annotated[
        bool, typer.Option("--stage", help="Do not queue it; start it later with 'mission start'.")
    ] = False,
) -> None:
    """Upload a mission and queue it as one task."""
    wished = terms.read()
    if stage and (wished or options.nonce):
        raise UsageError(
            "--stage: only --wait goes with it; a staged mission takes no other task option"
        )
    if stage and common.vehicle == ANY:
        raise UsageError("--stage: a mission is staged at one rover: name it with --vehicle N")
    plan, heard = read_plan(file), ChoiceHeard()
    async with opened(common) as client:
        with values_checked(), client.listening(heard.listen):
            if stage:
                task = await client.stage_mission(plan)
            else:
                task = await client.submit_mission(
                    plan, vehicle=rover_of(common), nonce=options.nonce, **wished
                )
        hint = " waits: mav-tasks mission start" if stage else heard.hint(task)
        await tell_submitted(client, task, common, is_awaited=options.wait, hint=hint)


@mission.command("start")
@command
async def start_mission(common: Common, wait: Wait = False) -> None:
    """Start the staged mission, or restart the last one.

    A ground station's upload or 'mission upload --stage' stages a mission.
    """
    async with opened(common) as client:
        task = await client.start_mission()
        await tell_submitted(client, task, common, is_awaited=wait)


@mission.command("download")
@command
async def download_mission(file: FileOut, common: Common, force: Force = False) -> None:
    """Save the staged mission of a rover to a file.

    A ground station's upload or 'mission upload --stage' stages a mission. A mission that
    'mission upload' queued is a task and cannot be downloaded.
    """
    _check_place(file, force=force)
    async with opened(common) as client:
        plan = await client.mission_file()
    _check_there(plan.items, "staged mission", note=" (queued missions are tasks)")
    _write(plan, file, f"{len(plan.items)} items", common)


@fence.command("upload")
@command
async def upload_fence(file: PlanIn, common: Common) -> None:
    """Upload the fence from a file to the rover."""
    plan = read_plan(file)
    if not plan.fence:
        words = "the rover's stays (mav-tasks fence clear removes it)"
        raise UsageError(f"{file} has no fence; {words}")
    async with opened(common) as client:
        count = await client.set_fence(plan)
    output.say_done(common.json, "fence upload", f"fence: {count} items", items=count)


@fence.command("clear")
@command
async def clear_fence(common: Common) -> None:
    """Remove the rover's fence."""
    async with opened(common) as client:
        await client.set_fence(NOTHING)
    output.say_done(common.json, "fence clear", "the rover has no fence now")


@fence.command("download")
@command
async def download_fence(file: PlanOut, common: Common, force: Force = False) -> None:
    """Save the rover's fence to a file."""
    _check_place(file, force=force)
    async with opened(common) as client:
        plan = await client.fence_file()
    _check_there(plan.fence, "fence")
    _write(plan, file, f"{len(plan.fence)} polygons and circles", common)


@rally.command("upload")
@command
async def upload_rally_points(file: PlanIn, common: Common) -> None:
    """Upload the rally points from a file to the rover."""
    plan = read_plan(file)
    if not plan.rally:
        words = "the rover's stay (mav-tasks rally clear removes them)"
        raise UsageError(f"{file} has no rally points; {words}")
    async with opened(common) as client:
        count = await client.set_rally_points(plan)
    output.say_done(common.json, "rally upload", f"rally: {count} items", items=count)


@rally.command("clear")
@command
async def clear_rally_points(common: Common) -> None:
    """Remove the rover's rally points."""
    async with opened(common) as client:
        await client.set_rally_points(NOTHING)
    output.say_done(common.json, "rally clear", "the rover has no rally points now")


def _check_place(file: str, *, force: bool) -> None:
    if file != STANDARD_OUTPUT and not force and Path(file).exists():
        raise UsageError(f"{file} exists; use --force to overwrite it")


def _check_there(parts: Sized, kind: str, *, note: str = "") -> None:
    """Raise Refused if there is nothing to write: an empty file would be misleading."""
    if not parts:
        words = f"the rover has no {kind}{note}; nothing written"
        raise Refused(words, result=0, reason=0)


def _write(plan: PlanFile, file: str, what: str, common: Common) -> None:
    if file == STANDARD_OUTPUT:
        sys.stdout.write(format_plan(plan))
        return
    write_plan(plan, Path(file))
    if common.json:
        output.say_json({"file": file, "items": len(plan.items) or len(plan.fence)})
    else:
        output.say(f"{file}: {what}")
