"""A bound on the sessions of agents that speak a version of the protocol with sessions. ASGI.

Anybody on this machine can open a session. So there are at most MOST, and a new one ends another:
one that no agent has used, else the one that has been idle for longest. The SDK opens one session
at a time, with a pause, so that others get their answers in between; an agent waits for its turn.
"""

import asyncio
from dataclasses import dataclass
from typing import Any

from mcp.shared.inbound import MCP_PROTOCOL_VERSION_HEADER
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST = 100  # sessions
PAUSE = 0.01  # s from one opening to the next
OPENING_BODY = 64 * 1024  # bytes
USED = 2  # requests after the opening; the first one only confirms it
SESSION = b"mcp-session-id"
VERSION = MCP_PROTOCOL_VERSION_HEADER.encode("ascii")


@dataclass(slots=True)
class _Session:
    requests: int = 0  # without those for its event stream
    running: int = 0  # of them


class HttpSessions:
    """The layer around the SDK's application."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._open: dict[bytes, _Session] = {}  # the longest idle first
        self._opening = asyncio.Lock()

    def __repr__(self) -> str:
        return f"HttpSessions({len(self._open)})"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        headers = dict(scope.get("headers", ()))
        name, version = headers.get(SESSION), headers.get(VERSION)
        has_sessions = version is None or version.decode("latin-1") in HANDSHAKE_PROTOCOL_VERSIONS
        if scope["type"] != "http" or not has_sessions:
            await self._app(scope, receive, send)
        elif name is None:
            await self._begin(scope, receive, send)
        else:
            await self._go_on(name, scope, receive, send)

    async def _go_on(self, name: bytes, scope: Scope, receive: Receive, send: Send) -> None:
        session = self._open.pop(name, None)
        if session is None or scope["method"] != "POST":
            if session is not None and scope["method"] != "DELETE":
                self._open[name] = session
            await self._app(scope, receive, send)
            return
        self._open[name] = session
        session.requests += 1
        session.running += 1
        try:
            await self._app(scope, receive, send)
        finally:
            session.running -= 1

    async def _begin(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the SDK open a session; end another one if there are too many."""
        body = await _whole(receive)
        if body is None:
            await PlainTextResponse("Request body too large", 413)(scope, receive, send)
            return
        waiting = [body]

        async def received() -> Message:
            return waiting.pop() if waiting else await receive()

        async def noted(message: Message) -> None:
            if message["type"] == "http.response.start":
                name = dict(message.get("headers", ())).get(SESSION)
                if name is not None and message["status"] < 400:
                    self._open[name] = _Session()
            await send(message)

        async with self._opening:
            await self._app(scope, received, noted)
            while len(self._open) > MOST:
                await self._end_one(scope)
            await asyncio.sleep(PAUSE)

    async def _end_one(self, scope: Scope) -> None:
        """End a session as an agent would end it: DELETE."""

        def worth(name: bytes) -> tuple[bool, bool]:
            session = self._open[name]
            return session.running > 0, session.requests >= USED

        name = min(self._open, key=worth)  # the longest idle of several
        del self._open[name]
        kept = [each for each in scope["headers"] if each[0] == b"host"]
        request = dict(scope) | {"method": "DELETE", "headers": [*kept, (SESSION, name)]}

        async def nothing() -> Message:
            return {"type": "http.request", "body": b"", "more_body": False}

        async def ignored(_message: Any) -> None:
            pass

        await self._app(request, nothing, ignored)


async def _whole(receive: Receive) -> Message | None:
    """Return the whole body, however slowly it comes; None if it is too long, or nobody waits."""
    body = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if message["type"] != "http.request" or len(body) > OPENING_BODY:
            return None
        if not message.get("more_body", False):
            return {"type": "http.request", "body": body, "more_body": False}
