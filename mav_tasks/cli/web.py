"""``mav-tasks web``: serve the web page and the HTTP API; and the tokens of their users."""

import os
from pathlib import Path
from typing import Annotated, Any

import typer

from mav_tasks.cli import output
from mav_tasks.cli.lazy import completing, group
from mav_tasks.cli.options import DEFAULT_SERVER, Json, RingFile, Server, SignWith
from mav_tasks.errors import UsageError
from mav_tasks.settings import ROLES

DEFAULT_LISTEN = "127.0.0.1:8560"

app = typer.Typer(rich_markup_mode=None)  # without a command it serves
tokens = group("Add, list and revoke the tokens of the web page and the HTTP API.")
app.add_typer(tokens, name="tokens")

TokenFile = Annotated[
    str,
    typer.Option(
        "--tokens",
        metavar="FILE",
        help="File of tokens; default: web-tokens.json in your configuration folder.",
    ),
]


@app.callback(invoke_without_command=True)
def web(
    ctx: typer.Context,
    server: Server = DEFAULT_SERVER,
    listen: Annotated[
        str,
        typer.Option(metavar="HOST:PORT", help="Address; beyond loopback, tokens are needed."),
    ] = DEFAULT_LISTEN,
    name: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST[:PORT]",
            help="A name or address by which browsers reach it, or its proxy; repeatable.",
        ),
    ] = None,
    role: Annotated[
        str,
        typer.Option(
            metavar="ROLE",
            autocompletion=completing("mav_tasks.settings:ROLES"),
            help="Role without a token, on loopback: observer, submitter, operator or safety; "
            '"": a token is required.',
        ),
    ] = "safety",
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
            help="Store whose journal the page shows; default: the store of the server that was "
            'started last on this machine; "": none.',
        ),
    ] = None,
    records: Annotated[
        str,
        typer.Option(
            metavar="FOLDER",
            help="Show the recordings in this folder (serve --tlog and --record) on the map.",
        ),
    ] = "",
    token_file: TokenFile = "",
    sign: SignWith = "",
    keys: RingFile = "",
) -> None:
    """Show and steer the rovers in a browser.

    Serves the web page and the HTTP API until Ctrl-C.

    On loopback no token is needed. The page is a client of the task server, like any other one.
    """
    if ctx.invoked_subcommand is not None:
        return
    serving = _loaded()
    host, port = _address(listen)
    if role and role not in ROLES:
        raise UsageError(f"--role {role}: expected one of {', '.join(ROLES)}")
    from mav_tasks.web.records import Records  # noqa: PLC0415
    from mav_tasks.web.tiles import tiles_of  # noqa: PLC0415  # with the extra only
    from mav_tasks.web.tokens import Tokens, load, path_of_tokens  # noqa: PLC0415

    path = path_of_tokens(token_file)
    known = load(path)
    if not serving.is_loopback(host):
        role = ""
        if not known:
            words = "add a token first: mav-tasks web tokens add NAME --role operator"
            raise UsageError(f"--listen {listen}: other machines reach it; {words}")
    options = serving.WebOptions(
        server=server,
        host=host,
        port=port,
        names=tuple(name or ()),
        role=role,
        tokens=Tokens(path),
        key=_key(sign, keys),
        journal=_journal(store),
        tiles=tiles_of(tiles) if tiles else None,
        records=Records(Path(records).expanduser()) if records else None,
    )
    bound = serving.listening(options)
    serving.run(options, bound, started=lambda address: output.say(f"web page: {address}"))


@tokens.command()
def add(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the person or program.")],
    role: Annotated[
        str,
        typer.Option(
            metavar="ROLE",
            autocompletion=completing("mav_tasks.settings:ROLES"),
            help="observer, submitter, operator or safety.",
        ),
    ],
    token_file: TokenFile = "",
) -> None:
    """Add a token and print it once; a running page accepts it at once."""
    from mav_tasks.web import tokens as kept  # noqa: PLC0415

    output.say(kept.add(kept.path_of_tokens(token_file), name, role))


@tokens.command(name="list")
def list_(token_file: TokenFile = "", as_json: Json = False) -> None:
    """List the tokens: names and roles."""
    from mav_tasks.web import tokens as kept  # noqa: PLC0415

    for token in kept.load(kept.path_of_tokens(token_file)):
        if as_json:
            output.say_json({"name": token.name, "role": token.role, "added": token.added})
        else:
            output.say(f"{token.name}  {token.role}  added {token.added}")


@tokens.command()
def revoke(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the token.")],
    token_file: TokenFile = "",
) -> None:
    """Revoke a token; a running page refuses it at once."""
    from mav_tasks.web import tokens as kept  # noqa: PLC0415

    kept.revoke(kept.path_of_tokens(token_file), name)
    output.say(f"token {name} revoked")


def _loaded() -> Any:
    """Return the module that serves. Raise UsageError if a package of the extra is missing."""
    try:
        from mav_tasks.web import serving  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise UsageError(f"the web page needs {error.name}: install mav-tasks[web]") from error
    return serving


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise UsageError(f"--listen {text}: expected HOST:PORT, such as {DEFAULT_LISTEN}")
    return host.removeprefix("[").removesuffix("]"), int(port)


def _key(sign: str, keys: str) -> Any:
    if not sign:
        if keys:
            raise UsageError("--keys needs --sign NAME")
        return None
    from mav_tasks.cli.ring import key_to_sign_with  # noqa: PLC0415

    return key_to_sign_with(sign, keys)


def _journal(store: str | None) -> Any:
    from mav_tasks.config.configuration import Sources  # noqa: PLC0415
    from mav_tasks.store.latest import latest_store  # noqa: PLC0415
    from mav_tasks.web.journal import Journal  # noqa: PLC0415

    if store is None:
        store = Sources(None, dict(os.environ)).load().settings.store or latest_store() or ""
    return Journal(store) if store else None
