"""``mav-tasks serve``: run the task server."""

import signal
from typing import Annotated

import typer

from mav_tasks.cli.lazy import completing
from mav_tasks.errors import StoreError

LINKS = (
    "udpin:host:port and tcpin:host:port listen, udpout: and tcp: connect, "
    "serial:/dev/ttyUSB0:57600 opens a serial port. Append ?unsigned=allow, ?unsigned=refuse or "
    "?key=NAME to set its signing rules."
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
            help="UDP address where a client listens; the server sends there first; repeatable. "
            "Default: 127.0.0.1:14550 and 127.0.0.1:14540.",
        ),
    ] = None,
    no_push: Annotated[bool, typer.Option("--no-push", help="Use no push addresses.")] = False,
    vehicle: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="Link to rovers, a URL as for --client; repeatable. "
            "Default: udpout:127.0.0.1:14580.",
        ),
    ] = None,
    arming: Annotated[
        str | None,
        typer.Option(
            metavar="WHO",
            autocompletion=completing("mav_tasks.settings:ARMING"),
            help="Who arms the rovers: server, operator, or auto (default): the server on loopback "
            "links, else the operator.",
        ),
    ] = None,
    store: Annotated[
        str | None,
        typer.Option(
            metavar="PATH|:memory:",
            help="SQLite file of the tasks; default: mav-tasks.sqlite3 in your data folder.",
        ),
    ] = None,
    keep_days: Annotated[
        str | None,
        typer.Option(
            metavar="DAYS",
            help="Delete finished tasks after this many days; 'forever': never; default: 30.",
        ),
    ] = None,
    keep_tasks: Annotated[
        str | None,
        typer.Option(
            metavar="COUNT",
            help="Keep at most this many finished tasks; 'forever': all; default: 10000.",
        ),
    ] = None,
    tlog: Annotated[
        str | None,
        typer.Option(
            metavar="FOLDER", help="Write telemetry logs (tlog) for ground stations to this folder."
        ),
    ] = None,
    record: Annotated[
        str | None,
        typer.Option(metavar="FOLDER", help="Write a record for mav-tasks replay to this folder."),
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Allow unsigned links that other machines can reach.")
    ] = False,
    keys: Annotated[
        str | None,
        typer.Option(
            metavar="FILE", help="Key ring file; default: keys.toml in your configuration folder."
        ),
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Log more details.")] = False,
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log JSON, one object per line.")
    ] = False,
    config: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help='Configuration file; default: config.toml in your configuration folder; "": none.',
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            autocompletion=completing("mav_tasks.cli.config:assignments"),
            help="Set any key of the configuration; repeatable.",
        ),
    ] = None,
) -> None:
    """Run the task server.

    By default clients connect to UDP 14560, and the server connects to the rover on UDP 14580.
    """
    if store == "":
        raise StoreError("--store: expected a path, or :memory:")
    # Ignore SIGHUP until the configuration is read; by default it would end the process.
    signal.signal(signal.SIGHUP, lambda _number, _frame: None)
    from mav_tasks.cli.serving import serve_with  # noqa: PLC0415  # takes long: after that

    given = (
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
    raise typer.Exit(serve_with(given, set_=set_ or (), config=config))
