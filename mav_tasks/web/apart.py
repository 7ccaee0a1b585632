"""Runs a function in a process of its own: a large request must not hold the event loop up.

A thread is not enough: parsers written in C keep the interpreter's lock until they have finished.
The process ends with the request, and with it all memory that the request needed.
"""

import asyncio
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from mav_tasks.errors import MavTasksError
from mav_tasks.web.problems import Problem, problem_of

WITHIN = 20.0  # s
NICE = 10  # it has time: the event loop comes first
COMMAND = (sys.executable, "-m", "mav_tasks.web.apart")

_one_at_a_time = asyncio.Lock()


async def apart(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function of a module returns. Raise the Problem that it raises, or if it fails.

    Functions run one after the other.
    """
    async with _one_at_a_time:
        return await asyncio.to_thread(_run, function, arguments)


def _run(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    try:
        ended = subprocess.run(
            COMMAND,
            input=pickle.dumps((function, arguments)),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=WITHIN,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        words = f"it could not be read within {WITHIN:g} s: send less, or try again"
        raise Problem(503, "Busy", words) from None
    problem, value = pickle.loads(ended.stdout)
    if problem is not None:
        raise Problem(*problem)
    return value


def main() -> None:
    """Run the function on standard input; write the parts of its Problem, if any, and its value."""
    os.nice(NICE)
    function, arguments = pickle.load(sys.stdin.buffer)
    try:
        answer: Any = None, function(*arguments)
    except (MavTasksError, ValueError) as error:
        problem = problem_of(error)
        answer = (problem.status, problem.title, problem.detail), None
    sys.stdout.buffer.write(pickle.dumps(answer))


if __name__ == "__main__":
    main()
