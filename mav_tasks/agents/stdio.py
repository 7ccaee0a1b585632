"""Serves one agent on standard input and output, until the agent closes them."""

import signal
from typing import Any

from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server


async def serve_stdio(server: Server[Any]) -> None:
    """Serve the program that started this process.

    Standard output carries only the protocol: all other output goes to standard error. Ctrl-C ends
    the process at once, because a thread may be reading standard input.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    async with stdio_server() as (received, sent):
        await server.run(received, sent, server.create_initialization_options())
