"""``mav-tasks qgc-actions``: print or install buttons for QGroundControl."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from platformdirs import user_documents_path

from mav_tasks.basics.errors import UsageError
from mav_tasks.plans import qgc_actions as files


def qgc_actions(
    custom: Annotated[
        bool, typer.Option("--custom", help="Use the older format of QGroundControl 4.3 and 4.4.")
    ] = False,
    action: Annotated[
        list[str] | None,
        typer.Option(metavar="LABEL=COMMAND,P1,...", help="Add a button; repeatable."),
    ] = None,
    only: Annotated[
        bool, typer.Option("--only", help="Leave out all buttons except those of --action.")
    ] = False,
    component: Annotated[
        int, typer.Option(min=1, max=255, metavar="N", help="Component id of the task server.")
    ] = 191,
    install: Annotated[
        bool,
        typer.Option("--install", help="Write files in both formats to QGroundControl's folders."),
    ] = False,
    documents: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER",
            help="With --install: use this folder instead of your documents folder.",
        ),
    ] = None,
) -> None:
    """Print or install action buttons for QGroundControl."""
    actions = [] if only else list(files.ACTIONS)
    actions += [files.parse_action(text) for text in action or []]
    if not actions:
        raise UsageError("--only: give at least one --action")
    if not install:
        file_type = files.CUSTOM_ACTIONS if custom else files.MAVLINK_ACTIONS
        sys.stdout.write(files.file_of(actions, file_type=file_type, component=component))
        return
    folder = user_documents_path() if documents is None else Path(documents)
    for path in files.install(folder, actions, component=component):
        sys.stdout.write(f"wrote {path}\n")
    sys.stdout.write(
        "Now select the file in QGroundControl: Application Settings, Fly View"
        " (4.3 and 4.4: General, Enable Custom Actions)\n"
    )
