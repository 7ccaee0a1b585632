"""The command line. Nothing heavy is imported before a command needs it."""

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from mav_tasks.errors import UsageError

EXIT_USAGE = 2

app = typer.Typer(
    help="A MAVLink task server: commands become queued tasks that a rover drives.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,  # plain help: rich alone would cost a third of the time to show it
    pretty_exceptions_enable=False,
)

LINKS = (
    "udpin:host:port or tcpin:… listens, udpout:… or tcp:… dials, "
    "serial:/dev/ttyUSB0:57600 is a line."
)
DEFAULT_CLIENTS = ["udpin:127.0.0.1:14560"]
DEFAULT_PUSH = ["127.0.0.1:14550", "127.0.0.1:14540"]
DEFAULT_VEHICLES = ["udpout:127.0.0.1:14580"]


@app.command()
def serve(
    client: Annotated[
        list[str],
        typer.Option(metavar="URL", help=f"Link for clients; repeatable. {LINKS}"),
    ] = DEFAULT_CLIENTS,
    push: Annotated[
        list[str],
        typer.Option(
            metavar="HOST:PORT", help="Where a client listens on UDP, unasked; repeatable."
        ),
    ] = DEFAULT_PUSH,
    no_push: Annotated[bool, typer.Option("--no-push", help="Push to nobody.")] = False,
    vehicle: Annotated[
        list[str],
        typer.Option(metavar="URL", help="Link to vehicles, of the same kinds; repeatable."),
    ] = DEFAULT_VEHICLES,
    arming: Annotated[
        str,
        typer.Option(help="Who arms: server, operator, or auto (server on loopback links only)."),
    ] = "auto",
    store: Annotated[
        str | None,
        typer.Option(
            metavar="PATH|:memory:",
            envvar="MAV_TASKS_STORE",
            help="Where tasks are kept; default: mav-tasks.sqlite3 in the user's data folder.",
        ),
    ] = None,
    keep_days: Annotated[
        float, typer.Option(min=0.0, help="Forget finished tasks after so many days.")
    ] = 30.0,
    keep_tasks: Annotated[
        int, typer.Option(min=0, help="Keep so many finished tasks at the most.")
    ] = 10_000,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow links that other machines can reach.")
    ] = False,
) -> None:
    """Run the task server: clients on UDP 14560, the rover on 14580."""
    from mav_tasks.serve import serve as run  # noqa: PLC0415

    raise typer.Exit(
        run(
            clients=client,
            push=[] if no_push else push,
            vehicles=vehicle,
            arming=arming,
            store=store,
            insecure=insecure,
            keep_days=keep_days,
            keep_tasks=keep_tasks,
        )
    )


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    add_help_option=False,
)
def sim(context: typer.Context) -> None:
    """Run simulated rovers on UDP 14580."""
    sys.stdout.flush()
    # The simulated rover is a program of its own: nothing of the server is in its process.
    os.execv(sys.executable, [sys.executable, "-m", "rover_sim", *context.args])


@app.command("qgc-actions")
def qgc_actions(
    custom: Annotated[
        bool, typer.Option("--custom", help="The older format, of QGroundControl 4.3 and 4.4.")
    ] = False,
    action: Annotated[
        list[str] | None,
        typer.Option(metavar="LABEL=COMMAND,P1,...", help="One more button; repeatable."),
    ] = None,
    only: Annotated[
        bool, typer.Option("--only", help="The buttons of --action, and no others.")
    ] = False,
    component: Annotated[
        int, typer.Option(min=1, max=255, help="Of the task server, if it is another.")
    ] = 191,
    install: Annotated[
        bool,
        typer.Option("--install", help="Write both formats to where QGroundControl looks."),
    ] = False,
    documents: Annotated[
        str | None,
        typer.Option(metavar="FOLDER", help="For --install: instead of your documents folder."),
    ] = None,
) -> None:
    """Print QGroundControl's actions file: buttons for the task commands."""
    from mav_tasks import qgc_actions as files  # noqa: PLC0415

    actions = [] if only else list(files.ACTIONS)
    actions += [files.parse_action(text) for text in action or []]
    if not actions:
        raise UsageError("--only: give at least one --action")
    if not install:
        file_type = files.CUSTOM_ACTIONS if custom else files.MAVLINK_ACTIONS
        sys.stdout.write(files.file_of(actions, file_type=file_type, component=component))
        return
    for path in files.install(_documents(documents), actions, component=component):
        sys.stdout.write(f"wrote {path}\n")
    sys.stdout.write("Choose it in QGroundControl: Application Settings, Fly View\n")


def _documents(folder: str | None) -> Path:
    if folder is not None:
        return Path(folder)
    from platformdirs import user_documents_path  # noqa: PLC0415

    return user_documents_path()


def main() -> None:
    """Entry point: one clear line for what the operator can mend, exit code 2."""
    try:
        app()
    except UsageError as error:
        sys.stderr.write(f"mav-tasks: {error}\n")
        sys.exit(EXIT_USAGE)


if __name__ == "__main__":
    main()
