"""Agents: the SDK's own client, against ``mav-tasks mcp`` on standard input and output, or HTTP."""

import os
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from mcp import StdioServerParameters
from mcp.client import Client
from mcp.client.extension import ClientExtension

from tests.kit.processes import Stand, environment_with


class Agent:
    """A connected agent."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.heard: list[tuple[float, str]] = []  # progress

    async def call(self, tool: str, **arguments: Any) -> dict[str, Any]:
        """Call a tool that succeeds; return its structured result."""
        done = await self.client.call_tool(tool, arguments, progress_callback=self._hear)
        assert not done.is_error, done.content
        found: dict[str, Any] = done.structured_content
        return found

    async def refused(self, tool: str, **arguments: Any) -> str:
        """Call a tool that is refused; return the reason."""
        done = await self.client.call_tool(tool, arguments)
        assert done.is_error, done
        (content,) = done.content
        assert content.type == "text"
        return content.text

    async def drive(self, key: str, *goals: dict[str, Any], **terms: Any) -> dict[str, Any]:
        """Submit a task; return it."""
        return await self.call("submit", goals=list(goals), idempotency_key=key, **terms)

    async def _hear(self, progress: float, total: float | None, message: str | None) -> None:
        self.heard.append((progress, message or ""))


def url_of(stand: Stand) -> str:
    """Return the server's URL for clients."""
    return f"udpout:127.0.0.1:{stand.client_port}"


@asynccontextmanager
async def agent(
    stand: Stand,
    folder: Path,
    *options: str,
    mode: str = "auto",
    extensions: Sequence[ClientExtension] = (),
) -> AsyncIterator[Agent]:
    """Run ``mav-tasks mcp`` on standard input and output for an agent.

    ``mode``: "legacy" for the protocol of 2025, "auto" for the newest one.
    """
    parameters = StdioServerParameters(
        command=sys.executable,
        args=["-m", "mav_tasks.cli", "mcp", "--server", url_of(stand), *options],
        env=environment_with(XDG_CONFIG_HOME=str(folder), XDG_STATE_HOME=str(folder)),
        cwd=folder,
    )
    with (folder / f"mcp-{os.urandom(4).hex()}.log").open("w") as log:
        from mcp.client.stdio import stdio_client

        transport = stdio_client(parameters, errlog=log)
        async with Client(transport, mode=mode, extensions=extensions) as client:
            yield Agent(client)
