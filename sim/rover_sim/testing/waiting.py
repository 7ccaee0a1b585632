"""Describes which tasks wait where, for a test whose wait never ends."""

import asyncio
import linecache
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any

MOST_TASKS = 8  # described at most
OURS = Path(__file__).parent  # frames that wrap the test's own coroutines are left out


def describe_tasks(loop: asyncio.AbstractEventLoop) -> str:
    """Return a line for each coroutine in which a task of the loop waits, outermost first."""
    tasks = sorted(asyncio.all_tasks(loop), key=lambda task: task.get_name())
    lines: list[str] = []
    for task in tasks[:MOST_TASKS]:
        lines.append(f"\n  {task.get_name()} waits:")
        lines += (
            f"\n    {_describe(frame)}"
            for frame in _frames(task.get_coro())
            if Path(frame.f_code.co_filename).parent != OURS
        )
    if len(tasks) > MOST_TASKS:
        lines.append(f"\n  and {len(tasks) - MOST_TASKS} more tasks")
    return "".join(lines)


def _frames(awaitable: Any) -> Iterator[FrameType]:
    """Yield the frames of a coroutine, of the one that it awaits, and so on."""
    while (frame := getattr(awaitable, "cr_frame", None)) is not None:
        yield frame
        awaitable = awaitable.cr_await


def _describe(frame: FrameType) -> str:
    code = frame.f_code
    line = linecache.getline(code.co_filename, frame.f_lineno).strip()
    return f"{Path(code.co_filename).name}:{frame.f_lineno} {code.co_qualname}: {line}"
