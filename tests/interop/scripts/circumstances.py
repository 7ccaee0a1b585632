"""Where a script finds the vehicle, what it is, and how often an operation may be tried.

``python -m tests.interop.scripts.NAME ADDRESS PERSONA TRIES``: with one try, the first error of
MAVSDK ends the script; with more it is the last one.
"""

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from io import TextIOWrapper
from typing import Any, Self

from tests.interop.scripts.facts import PERSONAS, Persona

PATIENCE = 40.0  # s for anything that is waited for
AGAIN = 1.0  # s after a failure: MAVSDK calls itself BUSY for a while after a time-out

# MAVSDK writes to the same output from threads of its own: each line of ours goes there whole
assert isinstance(sys.stdout, TextIOWrapper)
sys.stdout.reconfigure(line_buffering=True, write_through=False)


@dataclass(frozen=True)
class Circumstances:
    """What a script was told."""

    address: str
    persona: Persona
    tries: int
    errors: tuple[type[Exception], ...]  # those that MAVSDK declares

    @classmethod
    def from_arguments(cls, *errors: type[Exception]) -> Self:
        """Read the command line."""
        address, persona, tries = sys.argv[1:]
        return cls(address, PERSONAS[persona], int(tries), errors)

    @property
    def is_lossy(self) -> bool:
        """Whether something may get lost: then a report that comes once may not come at all."""
        return self.tries > 1

    def attempt(self, operation: Callable[..., Any], *arguments: Any) -> Any:
        """Call it until it succeeds; the last error is raised."""
        for left in reversed(range(self.tries)):
            try:
                return operation(*arguments)
            except self.errors as error:
                if not left:
                    raise
                _tell(operation, error)
                time.sleep(AGAIN)
        raise AssertionError("no tries")

    async def attempt_async(self, operation: Callable[..., Awaitable[Any]], *arguments: Any) -> Any:
        """As ``attempt``, of an operation to be awaited."""
        for left in reversed(range(self.tries)):
            try:
                return await operation(*arguments)
            except self.errors as error:
                if not left:
                    raise
                _tell(operation, error)
                await asyncio.sleep(AGAIN)
        raise AssertionError("no tries")


def _tell(operation: Callable[..., Any], error: Exception) -> None:
    result = getattr(error, "result", None) or getattr(error, "_result", error)
    print("again:", operation.__name__, getattr(result, "name", result))
