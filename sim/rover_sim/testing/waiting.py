"""Describes which tasks wait where, for a test whose wait never ends."""

import asyncio
import linecache
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def describe_tasks(loop: asyncio.AbstractEventLoop) -> str:
    """Return a line for each coroutine in which a task of the loop waits, outermost first."""
    tasks = sorted(asyncio.all_tasks(loop), key=asyncio.Task.get_name)
    return "".join(
        line
        for task in tasks
        for line in (f"\n  {task.get_name()} waits:", *_places(task.get_coro()))
    )


def _places(awaitable: Any) -> Iterator[str]:
    """Yield where a coroutine waits, the one that it awaits, and so on."""
    while (frame := getattr(awaitable, "cr_frame", None)) is not None:
        code, number = frame.f_code, frame.f_lineno
        line = linecache.getline(code.co_filename, number).strip()
        yield f"\n    {Path(code.co_filename).name}:{number} {code.co_qualname}: {line}"
        awaitable = awaitable.cr_await
