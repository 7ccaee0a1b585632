"""HTTP connections that end if their client stalls: uvicorn's protocol with time-outs.

uvicorn waits without limit for the first byte, for the end of a request's headers, and for a client
that does not read the answer.
"""

import asyncio
import socket
import struct
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_WITHIN = 10.0  # s without a request that is being answered
READ_WITHIN = 15.0  # s in which a client must read something of what waits for it
MOST = 800  # connections; a new one beyond that closes a stalled one


class PatientProtocol(H11Protocol):
    """One connection."""

    open_ones: ClassVar[dict["PatientProtocol", float]] = {}

    def connection_made(self, transport: Any) -> None:
        """Start the time-outs. If there are too many connections, close one that stalls."""
        super().connection_made(transport)
        self._full_since: float | None = None
        self._watch: asyncio.TimerHandle = self.loop.call_later(REQUEST_WITHIN, self._look)
        if len(self.open_ones) >= MOST:
            idle = next((each for each in self.open_ones if each.is_idle), None)
            spare = idle or next((each for each in self.open_ones if each.is_kept_waiting), None)
            if spare is not None:
                spare.transport.abort()
                self.open_ones.pop(spare, None)
        self.open_ones[self] = self.loop.time()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._watch.cancel()
        self.open_ones.pop(self, None)
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    @property
    def is_kept_waiting(self) -> bool:
        """Whether its client has not sent all of the request, or does not read the answer."""
        return self._full_since is not None or (self.cycle is not None and self.cycle.more_body)

    def pause_writing(self) -> None:
        """Note that the client does not read."""
        self._full_since = self.loop.time()
        super().pause_writing()

    def resume_writing(self) -> None:
        """Note that it reads again."""
        self._full_since = None
        super().resume_writing()

    def data_received(self, data: bytes) -> None:
        """Receive bytes. Once the headers of a request are complete, the connection is not idle."""
        super().data_received(data)
        if not self.is_idle:
            self.open_ones[self] = self.loop.time()

    def on_response_complete(self) -> None:
        """Start the time-out for the next request."""
        if self in self.open_ones:
            self.open_ones[self] = self.loop.time()
        super().on_response_complete()

    def _look(self) -> None:
        now, begun = self.loop.time(), self.open_ones.get(self, 0.0)
        if self._full_since is not None and now - self._full_since >= READ_WITHIN:
            # else the kernel keeps what is unread for many minutes
            held: socket.socket = self.transport.get_extra_info("socket")
            held.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.transport.abort()
            return
        if self.is_idle and now - begun >= REQUEST_WITHIN:
            self.transport.abort()
            return
        self._watch = self.loop.call_later(REQUEST_WITHIN / 2, self._look)
