"""``mav-tasks config``: show the values in force, check a file, write a sample file."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from mav_tasks.basics.errors import StoreError, UsageError
from mav_tasks.cli.lazy import group
from mav_tasks.config import configuration, report, toml_file
from mav_tasks.config.configuration import Sources
from mav_tasks.config.sample import sample
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.store.opening import kind_of

app = group("Show, check and create the configuration of the server.")
STANDARD_INPUT = STANDARD_OUTPUT = "-"


@app.command()
def show(
    keys: Annotated[
        list[str] | None,
        typer.Argument(metavar="[KEY]...", help="Keys or tables to print; default: all."),
    ] = None,
    config: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Configuration file; default: the file that serve would read."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print each key with its value and the source of the value."""
    names = report.chosen(keys or ())
    configuration = Sources(config, dict(os.environ)).load()
    shown = report.Report(configuration, _parameters(configuration.settings))
    sys.stdout.write(shown.as_json(names) if as_json else shown.as_toml(names))
    for words in shown.not_in_force:
        sys.stderr.write(f"mav-tasks: parameter of an earlier run ignored: {words}\n")


@app.command()
def check(
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="Configuration file; '-': standard input.")
    ],
) -> None:
    """Check a file: print "ok", or each error with its line and exit with 2."""
    if file == STANDARD_INPUT:
        data = sys.stdin.buffer.read(toml_file.LARGEST + 1)
        text = toml_file.decoded(data, name="standard input")
    else:
        text = toml_file.read_text(Path(file))
    name = "standard input" if file == STANDARD_INPUT else file
    configuration.merged([toml_file.layer_of(text, name=name)])
    sys.stdout.write("ok\n")


@app.command()
def init(
    path: Annotated[
        str | None, typer.Argument(help="New file; default, or '-': standard output.")
    ] = None,
) -> None:
    """Print or write a sample file.

    The sample lists each key with its meaning, range and default.
    """
    if path in (None, STANDARD_OUTPUT):
        sys.stdout.write(sample())
        return
    try:
        with Path(path).open("x", encoding="utf-8") as file:
            file.write(sample())
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
    sys.stdout.write(f"wrote {path}\n")


def assignments() -> list[str]:
    """Return the keys as ``serve --set`` takes them, for completion."""
    return [f"{name}=" for name in KEYS]


def _parameters(settings: ServerSettings) -> dict[str, float]:
    """Return the MAVLink parameters that clients have set; {} if the store cannot be read."""
    try:
        return kind_of(settings.store).read_parameters(settings.store)
    except StoreError as error:
        sys.stderr.write(f"mav-tasks: parameters set by clients are not shown: {error}\n")
        return {}
