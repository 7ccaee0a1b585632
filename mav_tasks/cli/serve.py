"""``mav-tasks serve``: run the task server."""

import os
import signal
from typing import Annotated

import typer

from mav_tasks.cli import completions

LINKS = (
    "udpin:host:port and tcpin:host:port listen, udpout: and tcp: dial, "
    "serial:/dev/ttyUSB0:57600 is a line; ?unsigned=allow, ?unsigned=refuse and ?key=NAME behind "
    "it say what is asked of signatures."
)


def serve(
    client: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help=f"Link for clients; repeatable. {LINKS} Default: udpin:127.0.0.1:14560.",
        ),
    ] = None,
    push: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST:PORT",
            help="Where a client listens on UDP, unasked; repeatable. "
            "Default: 127.0.0.1:14550 and 127.0.0.1:14540.",
        ),
    ] = None,
    no_push: Annotated[bool, typer.Option("--no-push", help="Push to nobody.")] = False,
    vehicle: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="Link to vehicles, of the same kinds; repeatable. "
            "Default: udpout:127.0.0.1:14580.",
        ),
    ] = None,
    arming: Annotated[
        str | None,
        typer.Option(
            metavar="WHO",
            autocompletion=completions.arming,
            help="Who arms: server, operator, or (default) auto: server on loopback links only.",
        ),
    ] = None,
    store: Annotated[
        str | None,
        typer.Option(
            metavar="PATH|:memory:",
            help="Where tasks are kept; default: mav-tasks.sqlite3 in the user's data folder.",
        ),
    ] = None,
    keep_days: Annotated[
        str | None,
        typer.Option(
            metavar="DAYS",
            help="Forget finished tasks after so many days, or forever; default: 30.",
        ),
    ] = None,
    keep_tasks: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT",
            help="Keep so many finished tasks at the most, or forever; default: 10000.",
        ),
    ] = None,
    tlog: Annotated[
        str | None,
        typer.Option(metavar="FOLDER", help="Keep telemetry logs that ground stations open."),
    ] = None,
    record: Annotated[
        str | None, typer.Option(metavar="FOLDER", help="Keep a record for mav-tasks replay.")
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow links that other machines can reach.")
    ] = False,
    keys: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="The key ring; default: keys.toml in the user's config folder."
        ),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Say more in the log, for the field.")
    ] = False,
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log one JSON object a line.")
    ] = False,
    config: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help='Configuration, see "mav-tasks config"; "" for no file at all.'
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            autocompletion=completions.settings,
            help="Any key of the configuration; repeatable.",
        ),
    ] = None,
) -> None:
    """Run the task server.

    By default clients use UDP 14560 and the rover uses 14580.
    """
    # Ignore SIGHUP until the configuration is read; by default it would end the process.
    signal.signal(signal.SIGHUP, lambda _number, _frame: None)
    from mav_tasks.config.configuration import Sources  # noqa: PLC0415
    from mav_tasks.config.reload import Reload  # noqa: PLC0415
    from mav_tasks.config.words import flag_of_set, given_flags  # noqa: PLC0415
    from mav_tasks.errors import StoreError  # noqa: PLC0415
    from mav_tasks.serve import serve as run  # noqa: PLC0415
    from mav_tasks.store.place import IN_MEMORY  # noqa: PLC0415

    if store == "":
        raise StoreError(f"--store: expected a path, or {IN_MEMORY}")
    flags = given_flags(
        ("--client", "links.clients", client or None),
        ("--no-push" if no_push else "--push", "links.push", [] if no_push else push or None),
        ("--vehicle", "links.vehicles", vehicle or None),
        ("--insecure", "links.insecure", insecure or None),
        ("--keys", "signing.keys", keys),
        ("--arming", "rules.arming", arming),
        ("--store", "store.path", store),
        ("--keep-days", "store.keep_days", keep_days),
        ("--keep-tasks", "store.keep_tasks", keep_tasks),
        ("--tlog", "recording.tlog", tlog),
        ("--record", "recording.decisions", record),
        ("--verbose", "log.level", "debug" if verbose else None),
        ("--log-json", "log.format", "json" if log_json else None),
    )
    flags += [flag_of_set(text) for text in set_ or ()]
    sources = Sources(config, dict(os.environ), flags)
    configuration = sources.load()
    raise typer.Exit(run(configuration.settings, reload=Reload(sources, configuration)))
