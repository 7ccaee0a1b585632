"""``mav-tasks submit``: submit a goal as a task."""

from collections.abc import Sequence
from inspect import Parameter, Signature
from math import radians
from typing import Annotated

import typer

from mav_tasks.basics.errors import ClientError
from mav_tasks.cli import output, words
from mav_tasks.cli.command import NUMBERS, NumbersCommand, command
from mav_tasks.cli.lazy import group
from mav_tasks.cli.options import AnyCommon, Common, TaskOptions
from mav_tasks.cli.parts import parameter_of, value_of
from mav_tasks.cli.places import parse_place
from mav_tasks.cli.session import ChoiceHeard, is_alone, opened, rover_of, values_checked
from mav_tasks.cli.terms import NewTerms
from mav_tasks.cli.typed_words import in_typed_words
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.json_form import task_json
from mav_tasks.client.wire import Goal
from mav_tasks.kinds import GoTo
from mav_tasks.kinds.form import Form
from mav_tasks.kinds.in_json import FORMS, GOTO, GOTO_GLOBAL, PLUGGED, made_of

EPILOG = """\b
Examples:
  mav-tasks submit move 2 --speed 0.5 --priority 8 --wait
  mav-tasks submit rotate -90 --after 12
  mav-tasks submit goto 47.3977 8.5456 --global --at 14:30
  mav-tasks submit act relay-on --param1 2"""

Speed = Annotated[
    float | None, typer.Option(metavar="M/S", help="Speed; default: driving.speed of the server.")
]
app = group("Submit a task.", epilog=EPILOG)


@command
async def goto(
    north: Annotated[
        str, typer.Argument(metavar="NORTH|LAT", help="Metres, or degrees with --global.")
    ],
    east: Annotated[
        str, typer.Argument(metavar="EAST|LON", help="Metres, or degrees with --global.")
    ],
    terms: NewTerms,
    options: TaskOptions,
    common: AnyCommon,
    is_global: Annotated[
        bool, typer.Option("--global", help="The numbers are latitude and longitude.")
    ] = False,
    is_local: Annotated[
        bool, typer.Option("--local", help="The numbers are metres north and east.")
    ] = False,
    speed: Speed = None,
    radius: Annotated[
        float | None,
        typer.Option(metavar="METRES", help="Acceptance radius; default: as close as possible."),
    ] = None,
    heading: Annotated[
        float | None, typer.Option(metavar="DEGREES", help="Final heading, clockwise from north.")
    ] = None,
) -> None:
    """Drive to a place: metres from the local origin, or latitude and longitude.

    The numbers are metres unless you give --global. If they look like degrees, --local or --global
    is required.
    """
    place = parse_place(north, east, is_global=is_global, is_local=is_local)
    way = GoTo(place, speed=speed, radius=radius, yaw=_maybe_radians(heading))
    await _submit([way], terms, options, common)


def _add(form: Form) -> None:
    """Add the command of a kind: its required parts are arguments, the others options."""

    async def submit(
        terms: NewTerms, options: TaskOptions, common: AnyCommon, **given: str | None
    ) -> None:
        pairs = ((part, given[part.name]) for part in form.numbers)
        parts = {part.name: value_of(part, text) for part, text in pairs if text is not None}
        await _submit(made_of(form, parts), terms, options, common)

    shared = [Parameter(n, Parameter.KEYWORD_ONLY, annotation=a) for n, a in SHARED.items()]
    submit.__signature__ = Signature([*map(parameter_of, form.numbers), *shared])  # type: ignore[attr-defined]
    submit.__doc__ = form.meaning
    add = app.command(form.name.replace("_", "-"), cls=NumbersCommand, context_settings=NUMBERS)
    add(command(submit))


SHARED = {"terms": NewTerms, "options": TaskOptions, "common": AnyCommon}


for each in FORMS:
    if each is GOTO:
        app.command(cls=NumbersCommand, context_settings=NUMBERS)(goto)
    elif each is not GOTO_GLOBAL:  # --global of the same command
        _add(each)


async def _submit(
    goals: Sequence[Goal], terms: NewTerms, options: TaskOptions, common: Common
) -> None:
    output.warn(PLUGGED.broken)
    wished, heard = terms.read(), ChoiceHeard()
    async with opened(common) as client:
        with values_checked(), in_typed_words(), client.listening(heard.listen):
            task = await client.submit(
                goals, vehicle=rover_of(common), nonce=options.nonce, **wished
            )
        hint = heard.hint(task)
        await tell_submitted(client, task, common, is_awaited=options.wait, hint=hint)


async def tell_submitted(
    client: Client, task: Task, common: Common, *, is_awaited: bool, hint: str = ""
) -> None:
    """Print the new task; follow it if ``is_awaited``."""
    if not common.json:
        output.say(f"rover {task.vehicle}: task {task.id}{hint}")
        if not is_awaited:  # ``follow`` shows each reason
            output.warn(await _why_it_waits(client, task, common))
    if is_awaited:
        from mav_tasks.cli.follow import follow  # noqa: PLC0415

        await follow(client, task, common)
    elif common.json:
        try:
            output.say_json(task_json(await task.refresh()))
        except ClientError:  # the task exists: do not lose its id
            output.say_json({"id": task.id, "vehicle": task.vehicle})


async def _why_it_waits(client: Client, task: Task, common: Common) -> str:
    """Return why the task does not start, and what to do; "" if it starts by itself."""
    try:
        status = await task.refresh()
        queue = await client.queue(vehicle=task.vehicle, limit=0)
    except ClientError:  # the task exists
        return ""
    return words.why_it_waits(status, queue, is_alone=is_alone(client, common))


def _maybe_radians(angle: float | None) -> float | None:
    return None if angle is None else radians(angle)
