"""``mav-tasks replay``: check that a recorded run decides the same again."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from mav_tasks.cli import exit_codes
from mav_tasks.cli.options import Json
from mav_tasks.config.key_ring.ring_file import load, path_of_ring
from mav_tasks.recording.reading import read
from mav_tasks.recording.replay import Replay
from mav_tasks.recording.report import Report


def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Record made by serve --record.")],
    json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print only the result.")] = False,
    keys: Annotated[
        str,
        typer.Option(
            metavar="FILE",
            help="Key ring of the recorded server, if it used signatures; default: keys.toml in "
            "your configuration folder.",
        ),
    ] = "",
) -> None:
    """Replay a record and compare the results.

    Runs the server's code on the recorded inputs, and prints what happens.

    Exit status 0: identical, bit for bit; 1: different; 2: the file cannot be read.
    """
    path = path_of_ring(keys)
    secrets = load(path).ring.secrets if keys or path.exists() else {}
    record = read(file)
    report = Report(sys.stdout, as_json=json, quiet=quiet)
    report.begin(record)
    running = Replay(record, secrets=secrets)
    for happened in running.events():
        report.tell(happened)
    report.conclude(record, running)
    raise typer.Exit(exit_codes.DONE if running.difference is None else exit_codes.FAILED)
