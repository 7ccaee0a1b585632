"""``mav-tasks dialect``: print the MAVLink definitions of the task messages."""

import sys
from typing import Annotated

import typer

from mav_tasks.basics.errors import UsageError
from mav_tasks.mavlink.definitions import DIALECT, folder_of_definitions


def dialect(
    path: Annotated[
        bool, typer.Option("--path", help="Print the folder of the XML files.")
    ] = False,
) -> None:
    """Print the MAVLink definitions of the task messages.

    The file includes common.xml, which every MAVLink generator has.
    """
    try:
        folder = folder_of_definitions()
    except FileNotFoundError as error:
        raise UsageError(str(error)) from error
    if path:
        sys.stdout.write(f"{folder}\n")
    else:
        sys.stdout.write((folder / DIALECT).read_text(encoding="utf-8"))
