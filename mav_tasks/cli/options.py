"""Options that many commands share, as groups for ``command``."""

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli.lazy import completing
from mav_tasks.cli.times import parse_duration, parse_moment
from mav_tasks.tasks.task import ANY

DEFAULT_SERVER = "udpout:127.0.0.1:14560"
DEFAULT_LISTEN = "127.0.0.1:8560"  # of the web page
PRIORITY = 5
NEVER = "never"  # of --every
MOST_ROVERS = 255  # system ids

StartIn = Annotated[
    str, typer.Option("--in", metavar="DURATION", help="Start after this delay: 30s, 5m, 1h30m.")
]
StartAt = Annotated[
    str,
    typer.Option(
        "--at",
        metavar="TIME",
        help="Start at 14:30 or 2026-11-20T14:30; local time unless it names a zone.",
    ),
]
Every = Annotated[
    str,
    typer.Option(
        metavar="PERIOD|CRON",
        help="Repeat: 90s, 1h30m, 1d, or a cron expression in UTC or a zone: "
        "'0 6 * * 1-5 Europe/Zurich'.",
    ),
]
Deadline = Annotated[
    str,
    typer.Option(
        metavar="DURATION", help="The task expires if it has not started within this time."
    ),
]
Wait = Annotated[
    bool,
    typer.Option(
        "--wait", "-w", help="Show the task until it ends; exit with 1 unless it completes."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, one object per line.")]
Server = Annotated[
    str,
    typer.Option(
        "--server",
        "-s",
        metavar="URL",
        envvar="MAV_TASKS_SERVER",
        help="URL of the task server: udpout:host:port, tcp:host:port, serial:device:baud.",
    ),
]
SignWith = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        envvar="MAV_TASKS_SIGN",
        autocompletion=completing("mav_tasks.cli.ring:key_names"),
        help="Sign with this key of the key ring.",
    ),
]
RingFile = Annotated[
    str,
    typer.Option(
        "--keys", metavar="FILE", help="Key ring file; default: signing.keys of the configuration."
    ),
]
TaskId = Annotated[int, typer.Argument(metavar="ID", min=1, help="Id of the task.")]


@dataclass(frozen=True, slots=True)
class Reach:
    """Options for reaching the server."""

    server: Server = DEFAULT_SERVER
    vehicle: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=MOST_ROVERS,
            metavar="N",
            help="System id of the rover, if the server has several.",
        ),
    ] = None
    timeout: Annotated[
        float,
        typer.Option(min=0.1, metavar="SECONDS", help="How long to look for the server."),
    ] = 5.0
    sign: SignWith = ""
    keys: RingFile = ""


@dataclass(frozen=True, slots=True)
class Common(Reach):
    """Options for reaching the server and showing its answers."""

    json: Json = False


def rover_or_any(text: str) -> int:
    """Return a system id, or ANY for the word "any". Raise BadParameter for another text."""
    if text == "any":
        return ANY
    if text.isdecimal() and 1 <= int(text) <= MOST_ROVERS:
        return int(text)
    raise typer.BadParameter(f"{text!r} is not in the range 1<=x<={MOST_ROVERS}, nor any.")


@dataclass(frozen=True, slots=True)
class AnyCommon(Common):
    """The same for new tasks, for which the server may choose the rover."""

    vehicle: Annotated[
        int | None,
        typer.Option(
            parser=rover_or_any,
            metavar="N|any",
            help="System id of the rover, if the server has several; any: the server chooses the"
            " one that would begin first.",
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class TaskOptions:
    """Options for when a new task runs, and whether the command waits for it."""

    priority: Annotated[
        int, typer.Option(metavar="0..10", help="Priority of the task; 10 is the highest.")
    ] = PRIORITY
    after: Annotated[
        int, typer.Option(metavar="ID", help="Run after this task has completed; 0: none.")
    ] = 0
    start_in: StartIn = ""
    start_at: StartAt = ""
    every: Every = ""
    deadline: Deadline = ""
    nonce: Annotated[
        int,
        typer.Option(
            metavar="NUMBER",
            help="Idempotency key: submissions with the same number make one task; 0: random.",
        ),
    ] = 0
    label: Annotated[
        str, typer.Option(metavar="TEXT", help="Name of the task, at most 24 bytes of UTF-8.")
    ] = ""
    wait: Wait = False


def start_of(start_in: str, start_at: str) -> tuple[float | None, datetime | None]:
    """Return the delay, s, of ``--in``, and the time of ``--at``; None: not given.

    Raise UsageError if one is invalid, or if both are given.
    """
    if start_in and start_at:
        raise UsageError("--in and --at: choose one of them")
    if not start_at:
        return seconds_of("--in", start_in), None
    return None, parse_moment("--at", start_at, now=datetime.now(UTC))


def every_of(text: str) -> float | str:
    """Return the argument ``every`` of the library for ``--every``; 0: not given, or "never".

    Raise UsageError for an invalid duration; the library checks the rest.
    """
    if text in ("", NEVER):
        return 0.0
    return text if len(text.split()) > 1 else parse_duration("--every", text)


def seconds_of(name: str, text: str) -> float | None:
    """Return the parsed duration of an option, s; None if it is not given."""
    if not text:
        return None
    return parse_duration(name, text)
