"""The users of the page: each is a key of the key ring, and a client of the task server.

A user's token is the key's secret in hexadecimal digits, as ``mav-tasks keys add`` prints it. What
a user asks for goes to the server on a connection of its own, signed with its key: so the server
knows who it is, and decides what it may do. A user at this machine without a key, and all reading,
share the connection of the web process.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from hmac import compare_digest

from mav_tasks.basics.errors import UsageError
from mav_tasks.client.aio import Client
from mav_tasks.config.key_ring.watch import RingWatch
from mav_tasks.mavlink.signing import Key
from mav_tasks.web.identity import Identity

LOOK = 1.0  # s between looks for unused connections
IDLE = 600.0  # s without a request, after which a user's connection is closed
MOST = 32  # connections that are kept: the server has room for 64 clients
#: kinds of links that a client can open more than once
EACH_OWN = ("udpout", "tcp")


@dataclass(eq=False)
class Line:
    """A connection to the server. ``name``: of its key, "" for that of the web process."""

    name: str
    client: Client
    used_at: float = 0.0

    @property
    def is_up(self) -> bool:
        """Whether the server has lately been heard on it."""
        return any(each.is_heard for each in self.client.vehicles())


class Users:
    """The users, and their connections. ``run`` keeps them until it is cancelled.

    ``connect`` returns a client that signs with a key; ``own`` is that of the web process, which
    signs with ``own_key``, if any.
    """

    def __init__(
        self,
        ring: RingWatch,
        own: Client,
        *,
        server: str,
        own_key: Key | None,
        connect: Callable[[Key], Client],
    ) -> None:
        self._ring = ring
        self._own, self._own_key = Line("", own), own_key
        self._server = server
        self._connect = connect
        self._lines: dict[Key, Line] = {}
        self._keys: dict[Key, bytes] = {}  # with the digest of its token
        self._take(ring.keys or ())

    def __repr__(self) -> str:
        return f"Users({len(self._keys)} keys, {len(self._lines)} connections)"

    async def run(self) -> None:
        """Follow the key ring, and close connections that nobody uses, until cancelled."""
        self._ring.begin(self._take)
        try:
            while True:
                await asyncio.sleep(LOOK)
                now = asyncio.get_running_loop().time()
                for key, line in list(self._lines.items()):
                    if now - line.used_at > IDLE or key not in self._keys:
                        await self._close(key)
        finally:
            self._ring.close()
            for key in list(self._lines):
                await self._close(key)

    # who it is

    @property
    def are_any(self) -> bool:
        """Whether a client has a key, also a revoked one, so that nobody is let in without one."""
        return any(key.role for key in self._ring.keys or ())

    def of_token(self, text: str) -> Key | None:
        """Return the key of a token; None: there is none, or it was revoked."""
        asked = _digest(text.strip().lower())
        found = [key for key, digest in self._keys.items() if compare_digest(digest, asked)]
        return found[0] if found else None

    def has(self, key: Key) -> bool:
        """Return whether a key is usable, with the same role."""
        return key in self._keys

    def _take(self, keys: tuple[Key, ...]) -> None:
        self._keys = {key: _digest(key.secret.hex()) for key in keys if key.secret and key.role}

    # its connection

    def ways_to_halt(self, identity: Identity) -> list[Line]:
        """Return the connections for a STOP or a pause, the best first.

        Every client may halt a rover: so this neither waits for a connection nor relies on one.
        """
        line = None if identity.key is None else self._lines.get(identity.key)
        return [self._own] if line is None or not line.is_up else [line, self._own]

    async def open(self, identity: Identity) -> Line:
        """Return a user's connection; it need not have the server yet. Raise UsageError."""
        key = identity.key
        if key is None or key == self._own_key:
            return self._own
        line = self._lines.get(key)
        if line is None:
            line = self._lines[key] = Line(key.name, self._opened(key))
        line.used_at = asyncio.get_running_loop().time()
        if len(self._lines) > MOST:
            await self._close(min(self._lines, key=lambda each: self._lines[each].used_at))
        return line

    def _opened(self, key: Key) -> Client:
        if self._server.partition(":")[0] not in EACH_OWN:
            its = "none" if self._own_key is None else self._own_key.name
            raise UsageError(
                f"only one client can use {self._server}, and it signs with key {its}: "
                "let the web process reach the server by udpout: or tcp:"
            )
        client = self._connect(key)
        client.open()
        return client

    async def _close(self, key: Key) -> None:
        await self._lines.pop(key).client.close()


def _digest(token: str) -> bytes:
    return sha256(token.encode()).digest()
