"""How a script with asyncio waits for what streams bring."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing
from typing import Any, Generic, Self, TypeVar

from tests.interop.scripts.circumstances import PATIENCE

T = TypeVar("T")
STEP = 0.05  # s


async def wait_for(
    condition: Callable[[], Awaitable[object]], what: str, *, within: float = PATIENCE
) -> None:
    """Ask until it is true; TimeoutError names what did not come.

    What is being asked is waited for even then: MAVSDK cannot be torn down in the middle of it.
    """
    loop = asyncio.get_running_loop()
    end = loop.time() + within
    while not await condition():
        if loop.time() > end:
            raise TimeoutError(what)
        await asyncio.sleep(STEP)


async def first(
    stream: AsyncGenerator[T, None], what: str, matching: Callable[[T], object] = lambda _: True
) -> T:
    """Return the first of a stream that matches, and end the subscription."""
    try:
        async with asyncio.timeout(PATIENCE), aclosing(stream):
            async for value in stream:
                if matching(value):
                    return value
    except TimeoutError as error:
        raise TimeoutError(what) from error
    raise AssertionError(f"a stream has ended: {what}")


async def wait_for_motion(velocities: AsyncGenerator[Any, None], *, moves: bool) -> None:
    """Wait until the rover drives, or stands."""

    def is_so(velocity: Any) -> bool:
        return (abs(velocity.north_m_s) + abs(velocity.east_m_s) > 0.2) is moves

    await first(velocities, "motion" if moves else "standstill", is_so)


class Watch(Generic[T]):
    """Follows a stream in the background and keeps what has come."""

    def __init__(self, stream: AsyncGenerator[T, None]) -> None:
        self.seen: list[T] = []
        self._changed = asyncio.Condition()
        self._task = asyncio.create_task(self._follow(stream))

    async def __aenter__(self) -> Self:
        await asyncio.sleep(0)  # the subscription is made when its task first runs
        return self

    async def __aexit__(self, *_: object) -> None:
        self._task.cancel()
        await asyncio.gather(self._task, return_exceptions=True)

    async def until(self, condition: Callable[[list[T]], object], what: str) -> None:
        """Wait until what has come satisfies it."""
        try:
            async with asyncio.timeout(PATIENCE), self._changed:
                await self._changed.wait_for(lambda: condition(self.seen))
        except TimeoutError as error:
            raise TimeoutError(f"{what}: {self.seen}") from error

    async def _follow(self, stream: AsyncGenerator[T, None]) -> None:
        async with aclosing(stream):
            async for value in stream:
                self.seen.append(value)
                async with self._changed:
                    self._changed.notify_all()
