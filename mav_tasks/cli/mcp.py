"""``mav-tasks mcp``: offer the task server to AI agents, by the Model Context Protocol."""

import sys
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Annotated

import typer

from mav_tasks.cli.command import command
from mav_tasks.cli.options import Reach
from mav_tasks.cli.session import unfound
from mav_tasks.errors import UsageError


@dataclass(frozen=True, slots=True)
class LimitOptions:
    """Options for what agents may submit."""

    read_only: Annotated[
        bool,
        typer.Option("--read-only", help="Offer only what changes nothing, and STOP."),
    ] = False
    max_distance: Annotated[
        float | None,
        typer.Option(
            metavar="METRES", min=0.0, help="Refuse a task that may drive farther than this."
        ),
    ] = None
    max_speed: Annotated[
        float | None,
        typer.Option(
            metavar="M/S",
            min=0.0,
            help="Refuse a goal that drives faster, or that names no speed.",
        ),
    ] = None
    max_queued: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help="Refuse a task if its rover already has so many tasks."
        ),
    ] = None


@command
async def mcp(
    reach: Reach,
    limits: LimitOptions,
    http: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve streamable HTTP on this loopback address, instead of standard input and"
            " output.",
        ),
    ] = "",
) -> None:
    """Offer the task server to AI agents (Model Context Protocol).

    An agent's program starts this command and talks to it on standard input and output. With --sign
    agents have the role of that key. With --vehicle only that rover is offered.
    """
    if find_spec("mcp") is None:
        raise UsageError("mcp needs the MCP SDK: pip install 'mav-tasks[mcp]'")
    from mav_tasks.agents.limits import Limits  # noqa: PLC0415  # they need the SDK
    from mav_tasks.agents.rovers import Rovers  # noqa: PLC0415
    from mav_tasks.agents.server import server_of  # noqa: PLC0415
    from mav_tasks.agents.stdio import serve_stdio  # noqa: PLC0415
    from mav_tasks.agents.streamable_http import place_of, serve_http  # noqa: PLC0415

    place = place_of(http) if http else None
    allowed = Limits(limits.max_distance, limits.max_speed, limits.max_queued)
    async with unfound(reach) as client:
        rovers = Rovers(client, only=reach.vehicle, limits=allowed)
        server = server_of(rovers, is_read_only=limits.read_only)
        if place is None:
            await serve_stdio(server)
        else:
            await serve_http(server, place, _tell_url)


def _tell_url(url: str) -> None:
    sys.stderr.write(f"agents can use {url}\n")
    sys.stderr.flush()
