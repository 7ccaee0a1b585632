"""``mav-tasks submit``: submit a goal as a task."""

from collections.abc import Sequence
from math import radians
from typing import Annotated

import typer

from mav_tasks.cli import output, words
from mav_tasks.cli.command import NUMBERS, NumbersCommand, command
from mav_tasks.cli.lazy import group
from mav_tasks.cli.options import AnyCommon, Common, TaskOptions
from mav_tasks.cli.places import parse_place
from mav_tasks.cli.session import ChoiceHeard, is_alone, opened, read, rover_of, values_checked
from mav_tasks.cli.times import parse_duration
from mav_tasks.cli.typed_words import in_typed_words
from mav_tasks.client.aio import Client
from mav_tasks.client.handle import Task
from mav_tasks.client.json_form import task_json
from mav_tasks.client.wire import Goal
from mav_tasks.errors import ClientError
from mav_tasks.kinds import Drive, Face, GoTo, Move, Rotate, Wait

EPILOG = """\b
Examples:
  mav-tasks submit move 2 --speed 0.5 --priority 8 --wait
  mav-tasks submit rotate -90 --after 12
  mav-tasks submit goto 47.3977 8.5456 --global --at 14:30"""

Speed = Annotated[
    float | None, typer.Option(metavar="M/S", help="Speed; default: driving.speed of the server.")
]
Rate = Annotated[
    float | None,
    typer.Option(metavar="DEG/S", help="Turn rate; default: driving.turn_rate_deg of the server."),
]

app = group("Submit a task.", epilog=EPILOG)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def move(
    distance: Annotated[
        float, typer.Argument(metavar="METRES", help="Distance; negative: backwards.")
    ],
    terms: TaskOptions,
    common: AnyCommon,
    speed: Speed = None,
) -> None:
    """Drive straight along the heading."""
    await _submit([Move(distance, speed)], terms, common)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def rotate(
    angle: Annotated[float, typer.Argument(metavar="DEGREES", help="Angle; positive: clockwise.")],
    terms: TaskOptions,
    common: AnyCommon,
    rate: Rate = None,
) -> None:
    """Turn on the spot by an angle."""
    await _submit([Rotate(radians(angle), _maybe_radians(rate))], terms, common)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def drive(
    forward: Annotated[float, typer.Argument(metavar="M/S", help="Speed; negative: backwards.")],
    yaw_rate: Annotated[
        float, typer.Argument(metavar="DEG/S", help="Yaw rate; positive: clockwise.")
    ],
    duration: Annotated[str, typer.Argument(metavar="DURATION", help="How long, for example 5s.")],
    terms: TaskOptions,
    common: AnyCommon,
) -> None:
    """Drive at a constant velocity for some time."""
    seconds = parse_duration("DURATION", duration)
    await _submit([Drive(forward, radians(yaw_rate), seconds)], terms, common)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def goto(
    north: Annotated[
        str, typer.Argument(metavar="NORTH|LAT", help="Metres, or degrees with --global.")
    ],
    east: Annotated[
        str, typer.Argument(metavar="EAST|LON", help="Metres, or degrees with --global.")
    ],
    terms: TaskOptions,
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
    await _submit([way], terms, common)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def face(
    heading: Annotated[
        float, typer.Argument(metavar="DEGREES", help="Heading, clockwise from north.")
    ],
    terms: TaskOptions,
    common: AnyCommon,
    rate: Rate = None,
) -> None:
    """Turn on the spot to a heading."""
    await _submit([Face(radians(heading), rate=_maybe_radians(rate))], terms, common)


@app.command(cls=NumbersCommand, context_settings=NUMBERS)
@command
async def wait(
    duration: Annotated[
        str, typer.Argument(metavar="DURATION", help="How long, for example 30s or 5m.")
    ],
    terms: TaskOptions,
    common: AnyCommon,
) -> None:
    """Stand still for some time."""
    await _submit([Wait(parse_duration("DURATION", duration))], terms, common)


@app.command()
@command
async def home(terms: TaskOptions, common: Common, speed: Speed = None) -> None:
    """Return to the rover's home."""
    await _submit([GoTo(None, speed=speed)], terms, common)


async def _submit(goals: Sequence[Goal], terms: TaskOptions, common: Common) -> None:
    wished, heard = read(terms), ChoiceHeard()
    async with opened(common) as client:
        with values_checked(), in_typed_words(), client.listening(heard.listen):
            task = await client.submit(goals, vehicle=rover_of(common), **wished)
        hint = heard.hint(task)
        await tell_submitted(client, task, common, is_awaited=terms.wait, hint=hint)


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
