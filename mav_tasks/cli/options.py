"""Options that many commands share, as groups for ``command``."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from mav_tasks.cli import completions
from mav_tasks.errors import UsageError

if TYPE_CHECKING:
    from datetime import datetime

DEFAULT_SERVER = "udpout:127.0.0.1:14560"
PRIORITY = 5

StartIn = Annotated[
    str, typer.Option("--in", metavar="DURATION", help="Start no earlier: 30s, 5m, 1h30m.")
]
StartAt = Annotated[
    str,
    typer.Option(
        "--at", metavar="TIME", help="Start at 14:30 or 2026-11-20T14:30, local unless it says so."
    ),
]
Deadline = Annotated[
    str, typer.Option(metavar="DURATION", help="It must have begun by then, else it expires.")
]
Wait = Annotated[bool, typer.Option("--wait", "-w", help="Wait until it is over, and show it.")]
TaskId = Annotated[int, typer.Argument(metavar="ID", min=1, help="Of the task.")]


@dataclass(frozen=True, slots=True)
class Common:
    """Options for reaching the server and showing its answers."""

    server: Annotated[
        str,
        typer.Option(
            "--server",
            "-s",
            metavar="URL",
            envvar="MAV_TASKS_SERVER",
            help="Of the task server: udpout:host:port, tcp:host:port, serial:device:baud.",
        ),
    ] = DEFAULT_SERVER
    vehicle: Annotated[
        int | None,
        typer.Option(min=1, max=255, metavar="N", help="Which rover, where there are several."),
    ] = None
    timeout: Annotated[
        float,
        typer.Option(min=0.1, metavar="SECONDS", help="Until a server must have been found."),
    ] = 5.0
    json: Annotated[bool, typer.Option("--json", help="Print JSON, one object a line.")] = False
    sign: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            envvar="MAV_TASKS_SIGN",
            autocompletion=completions.key_names,
            help="Sign with this key of the key ring.",
        ),
    ] = ""
    keys: Annotated[
        str,
        typer.Option(metavar="FILE", help="The key ring; default: as the configuration says."),
    ] = ""


@dataclass(frozen=True, slots=True)
class TaskOptions:
    """Options for when a new task runs, and whether the command waits for it."""

    priority: Annotated[int, typer.Option(metavar="0..10", help="10 runs first.")] = PRIORITY
    after: Annotated[
        int, typer.Option(metavar="ID", help="A task that must complete first; 0: none.")
    ] = 0
    start_in: StartIn = ""
    start_at: StartAt = ""
    deadline: Deadline = ""
    nonce: Annotated[
        int,
        typer.Option(metavar="NUMBER", help="The task's own mark, for a second try; 0: random."),
    ] = 0
    label: Annotated[str, typer.Option(metavar="TEXT", help="A name for it: 24 bytes.")] = ""
    wait: Wait = False


@dataclass(frozen=True, slots=True)
class Start:
    """A start delay in seconds, a start time, or neither."""

    delay: float | None
    at: "datetime | None"


def start_of(start_in: str, start_at: str) -> Start:
    """Return the parsed ``--in`` or ``--at``. Raise UsageError if invalid, or if both are given."""
    if start_in and start_at:
        raise UsageError("--in and --at: choose one of them")
    if not start_at:
        return Start(seconds_of("--in", start_in), None)
    from datetime import UTC, datetime  # noqa: PLC0415

    from mav_tasks.cli.times import parse_moment  # noqa: PLC0415

    return Start(None, parse_moment("--at", start_at, now=datetime.now(UTC)))


def seconds_of(name: str, text: str) -> float | None:
    """Return the parsed duration of an option, s; None if it is not given."""
    if not text:
        return None
    from mav_tasks.cli.times import parse_duration  # noqa: PLC0415

    return parse_duration(name, text)
