"""Halts of one kind share an answer if clients repeat them before it arrives.

The client library has one request of a kind in flight and queues the others. A program that repeats
STOP would fill that queue: another person's STOP would be acknowledged minutes later, and the
queued ones would stop the rover again after a resume.

A request shares only the answer of one that is still queued: an answer to a request in flight may
be older than a resume.
"""

import asyncio
from collections.abc import Awaitable, Callable, Hashable


class Flights:
    """For each kind of halt one request in flight, and one that waits for its turn."""

    def __init__(self) -> None:
        self._flying: dict[Hashable, asyncio.Future[None]] = {}
        self._waiting: dict[Hashable, asyncio.Future[None]] = {}

    def __repr__(self) -> str:
        return f"Flights({len(self._flying)} flying, {len(self._waiting)} waiting)"

    def waiting(self, kind: Hashable) -> asyncio.Future[None] | None:
        """Return the answer that a further request of a kind will share; None: it gets its own."""
        return self._waiting.get(kind)

    async def join(self, kind: Hashable, send: Callable[[], Awaitable[None]]) -> None:
        """Send a request, or share the answer of the waiting one. Raise what ``send`` raises."""
        shared = self._waiting.get(kind)
        if shared is not None:
            await asyncio.shield(shared)
            return
        answer: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        (self._waiting if kind in self._flying else self._flying)[kind] = answer
        try:
            await send()
        except BaseException as error:
            self._end(kind, answer)
            is_failure = isinstance(error, Exception)
            answer.set_exception(error if is_failure else ConnectionAbortedError("it has ended"))
            answer.exception()  # nobody may share it
            raise
        self._end(kind, answer)
        answer.set_result(None)

    def _end(self, kind: Hashable, answer: asyncio.Future[None]) -> None:
        if self._waiting.get(kind) is answer:
            del self._waiting[kind]
        elif self._flying.get(kind) is answer:
            following = self._waiting.pop(kind, None)
            if following is None:
                del self._flying[kind]
            else:
                self._flying[kind] = following
