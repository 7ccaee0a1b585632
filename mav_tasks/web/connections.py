"""HTTP connections that cannot be held open for nothing: uvicorn's protocol with time-outs.

uvicorn waits without limit for the first byte and for the end of a request's headers.
"""

import asyncio
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_WITHIN = 10.0  # s without a request that is being answered
MOST = 800  # connections; the one that has been idle for the longest time makes room


class PatientProtocol(H11Protocol):
    """One connection."""

    open_ones: ClassVar[dict["PatientProtocol", float]] = {}

    def connection_made(self, transport: Any) -> None:
        """Begin; close an idle connection if there are too many."""
        super().connection_made(transport)
        self._watch: asyncio.TimerHandle = self.loop.call_later(REQUEST_WITHIN, self._look)
        if len(self.open_ones) >= MOST:
            idle = [each for each in self.open_ones if each.is_idle]
            if idle:
                idle[0].transport.abort()
                self.open_ones.pop(idle[0], None)
        self.open_ones[self] = self.loop.time()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._watch.cancel()
        self.open_ones.pop(self, None)
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        """Take bytes; a request whose headers are whole is being answered from then on."""
        super().data_received(data)
        if not self.is_idle:
            self.open_ones[self] = self.loop.time()

    def on_response_complete(self) -> None:
        """Count from the end of an answer."""
        if self in self.open_ones:
            self.open_ones[self] = self.loop.time()
        super().on_response_complete()

    def _look(self) -> None:
        begun = self.open_ones.get(self, 0.0)
        if self.is_idle and self.loop.time() - begun >= REQUEST_WITHIN:
            self.transport.abort()
            return
        self._watch = self.loop.call_later(REQUEST_WITHIN / 2, self._look)
