"""Options that many commands share, as groups for ``command``."""

from dataclasses import dataclass
from typing import Annotated

import typer

from mav_tasks.cli.lazy import completing
from mav_tasks.tasks.task import ANY

DEFAULT_SERVER = "udpout:127.0.0.1:14560"
DEFAULT_LISTEN = "127.0.0.1:8560"  # of the web page
MOST_ROVERS = 255  # system ids

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
    """Options for how a new task is submitted, and whether the command waits for it."""

    nonce: Annotated[
        int,
        typer.Option(
            metavar="NUMBER",
            help="Idempotency key: submissions with the same number make one task; 0: random.",
        ),
    ] = 0
    wait: Wait = False
