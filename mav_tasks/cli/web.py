"""``mav-tasks web``: serve the web page and the HTTP API."""

import os
from typing import Annotated, Any

import typer

from mav_tasks.basics.errors import UsageError, missing
from mav_tasks.basics.folders import at_home
from mav_tasks.cli import output
from mav_tasks.cli.options import DEFAULT_LISTEN, DEFAULT_SERVER, RingFile, Server, SignWith
from mav_tasks.cli.page_beside import end_with_input
from mav_tasks.cli.ring import key_to_sign_with, ring_path
from mav_tasks.config.key_ring.ring_file import load
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.kinds.in_json import PLUGGED

app = typer.Typer(rich_markup_mode=None)  # without a command it serves
KEYS = "mav-tasks keys add NAME --role operator prints a token; keys list and revoke manage them"
OLD_TOKENS = "web-tokens.json"

Gone = Annotated[str | None, typer.Option(hidden=True)]


@app.callback(invoke_without_command=True)
def web(
    ctx: typer.Context,
    server: Server = DEFAULT_SERVER,
    listen: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="Address; beyond loopback, users need tokens."),
    ] = DEFAULT_LISTEN,
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST[:PORT]",
            help="A name or address by which browsers reach it, or its proxy; users need tokens "
            "then; repeatable.",
        ),
    ] = None,
    tiles: Annotated[
        str,
        typer.Option(
            metavar="FILE|URL",
            help="Map tiles: an MBTiles file, or a URL with {z}, {x} and {y}; default: a grid.",
        ),
    ] = "",
    store: Annotated[
        str | None,
        typer.Option(
            metavar="PATH|URL",
            help="Store whose journal the page shows; default: the store of the server that runs, "
            'or ran last, on this machine; "": none.',
        ),
    ] = None,
    records: Annotated[
        str,
        typer.Option(
            metavar="FOLDER",
            help="Show the recordings in this folder (serve --tlog and --record) on the map.",
        ),
    ] = "",
    sign: SignWith = "",
    keys: RingFile = "",
    beside_server: Annotated[bool, typer.Option(hidden=True)] = False,
    role: Gone = None,
    tokens: Gone = None,
) -> None:
    """Show and steer the rovers in a browser.

    Serves the web page and the HTTP API until Ctrl-C.

    Each user logs in with a key of the key ring, and the task server decides what it may do. On
    loopback nobody needs to, as long as the ring has no key of a client.
    """
    if ctx.invoked_subcommand is not None:
        return
    serving = _loaded()
    host, port = _address(listen)
    if role is not None:
        words = "the server decides what a page without a token may do: serve --set roles.unsigned="
        raise UsageError(f"--role: {words}{role or 'observer'}; for a token: {KEYS}")
    if tokens is not None:
        raise UsageError(f"--tokens: the page's tokens are keys of the key ring now: {KEYS}")
    from mav_tasks.web.records import Records  # noqa: PLC0415
    from mav_tasks.web.tiles import tiles_of  # noqa: PLC0415  # with the extra only

    ring = _ring(keys)
    is_far = bool(name) or not serving.is_loopback(host)
    if is_far and not any(key.secret and key.role for key in ring.keys or ()):
        where = f"--name {name[0]}" if name else f"--listen {listen}"
        raise UsageError(f"{where}: who sits elsewhere needs a token. {KEYS} (ring: {ring.path})")
    output.warn(PLUGGED.broken)
    old = ring.path.with_name(OLD_TOKENS)
    if old.exists():
        output.warn(f"{old} is not used any more: {KEYS}")
    options = serving.WebOptions(
        server=server,
        host=host,
        port=port,
        names=tuple(name or ()),
        ring=ring,
        key=key_to_sign_with(sign, keys) if sign else None,
        journal=_journal(store),
        tiles=tiles_of(tiles) if tiles else None,
        records=Records(at_home(records, what="--records")) if records else None,
    )
    bound = serving.listening(options)
    if beside_server:
        end_with_input()
    serving.run(options, bound, started=lambda address: output.say(f"web page: {address}"))


@app.command(hidden=True, context_settings={"ignore_unknown_options": True})
def tokens(words: Annotated[list[str] | None, typer.Argument()] = None) -> None:
    """Say what took the place of tokens of the page's own."""
    del words
    raise UsageError(f"web tokens: the page's tokens are keys of the key ring now: {KEYS}")


def _loaded() -> Any:
    """Return the module that serves. Raise UsageError if a package of the extra is missing."""
    try:
        from mav_tasks.web import serving  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UsageError(f"the web page {missing(str(error.name), 'web')}") from error
    return serving


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise UsageError(f"--listen {text}: expected HOST:PORT, such as {DEFAULT_LISTEN}")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _ring(asked: str) -> RingWatch:
    """Return a watch on the key ring; only one that is not named may be missing."""
    path = ring_path(asked)
    is_there = asked or os.path.lexists(path)
    return RingWatch(path, load(path) if is_there else None)


def _journal(store: str | None) -> Any:
    from mav_tasks.config.configuration import Sources  # noqa: PLC0415
    from mav_tasks.store.latest import latest_store  # noqa: PLC0415
    from mav_tasks.web.journal import Journal  # noqa: PLC0415

    if store is None:
        store = Sources(None, dict(os.environ)).load().settings.store or latest_store() or ""
    return Journal(store) if store else None
