"""``mav-tasks mcp``: offer the task server to AI agents, by the Model Context Protocol."""

import sys
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Annotated, Any

import typer

from mav_tasks.basics.errors import UsageError, missing
from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Reach
from mav_tasks.cli.session import signing_key, unfound
from mav_tasks.kinds.in_json import PLUGGED


def _gone(name: str) -> Any:
    """Return an option that is refused: the server keeps the limits of agents, by their key."""

    def refuse(value: str) -> str:
        if value:
            limit = "quota" if name == "max-queued" else name
            add = f"mav-tasks keys add agent --role submitter --{limit} {value}"
            words = f"--{name}: the server keeps the limits of an agent's key: {add}"
            raise UsageError(f"{words}, then mav-tasks mcp --sign agent")
        return value

    return typer.Option(f"--{name}", hidden=True, callback=refuse)


@dataclass(frozen=True, slots=True)
class AgentOptions:
    """Options for what agents are offered."""

    read_only: Annotated[
        bool,
        typer.Option("--read-only", help="Offer only what changes nothing, and STOP."),
    ] = False
    http: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve streamable HTTP on this loopback address, instead of standard input and"
            " output.",
        ),
    ] = ""
    max_distance: Annotated[str, _gone("max-distance")] = ""
    max_speed: Annotated[str, _gone("max-speed")] = ""
    max_queued: Annotated[str, _gone("max-queued")] = ""


@command
async def mcp(reach: Reach, options: AgentOptions) -> None:
    """Offer the task server to AI agents (Model Context Protocol).

    An agent's program starts this command and talks to it on standard input and output. With --sign
    agents have the role and the limits of that key. With --vehicle only that rover is offered.
    """
    if find_spec("mcp") is None:
        raise UsageError(f"mcp {missing('mcp', 'mcp')}")
    from mav_tasks.agents.rovers import Rovers  # noqa: PLC0415  # they need the SDK
    from mav_tasks.agents.server import server_of  # noqa: PLC0415
    from mav_tasks.agents.stdio import serve_stdio  # noqa: PLC0415
    from mav_tasks.agents.streamable_http import place_of, serve_http  # noqa: PLC0415
    from mav_tasks.config.key_ring.limits import limits_in_words  # noqa: PLC0415

    output.warn(PLUGGED.broken)
    place = place_of(options.http) if options.http else None
    key = signing_key(reach)
    signer, limits = ("", "") if key is None else (key.fingerprint, limits_in_words(key.limits))
    async with unfound(reach) as client:
        rovers = Rovers(client, only=reach.vehicle, signer=signer)
        server = server_of(rovers, is_read_only=options.read_only, limits=limits)
        if place is None:
            await serve_stdio(server)
        else:
            await serve_http(server, place, _tell_url)


def _tell_url(url: str) -> None:
    sys.stderr.write(f"agents can use {url}\n")
    sys.stderr.flush()
