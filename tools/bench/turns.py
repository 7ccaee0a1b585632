"""The cost of one TASK_MOVE in the engine: calls and CPU time, compared with another revision.

``turn_child`` defines a turn and an idle wake-up. Calls are those of Python functions and, where
stated, also of C functions; both are exact and the same in each run.
"""

import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from tests.kit.other_revision import checked_out

from .child import END_WITHIN, ROOT
from .table import Row

CHILD = Path(__file__).with_name("turn_child.py")
FIRST = "7ae03a8"  # the revision to which the goals refer
ROUNDS = 9
TURNS = 1_000  # in each round
GOAL_CALLS = 200
GOAL_WAKE_UP = 40
GOAL_CPU = 2.0  # times less than the other revision


def measure(against: str = FIRST, *, names: int = 0) -> list[Row]:
    """Return the rows of calls and time; print the ``names`` most called functions."""
    with ExitStack() as stack:
        theirs = stack.enter_context(_asked(stack.enter_context(checked_out(against))))
        ours = stack.enter_context(_asked(ROOT))
        here, there = ours.calls(), theirs.calls()
        times: list[tuple[float, float]] = []
        for number in range(ROUNDS):  # alternate: the second one has a colder cache
            first, second = (ours, theirs) if number % 2 else (theirs, ours)
            seconds = {each: each.cpu() for each in (first, second)}
            times.append((seconds[ours], seconds[theirs]))
    for line in _most_called(here, names):
        print(line)
    return [*_rows_of_calls(here, there, against), _row_of_cpu(times, against)]


class _Asked:
    """A child that answers lines."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self._answer()

    def calls(self) -> Any:
        return self._ask("calls")

    def cpu(self) -> float:
        return float(self._ask(f"cpu {TURNS}"))

    def _ask(self, line: str) -> Any:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{CHILD.name} ended: see above")
        return json.loads(line)


@contextmanager
def _asked(tree: Path) -> Iterator[_Asked]:
    """Run the child on the modules of a tree for a ``with`` block."""
    process = subprocess.Popen(
        [sys.executable, "-P", str(CHILD)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree), "PYTHONHASHSEED": "0"},
    )
    try:
        yield _Asked(process)
    finally:
        assert process.stdin is not None
        process.stdin.close()
        process.wait(END_WITHIN)


def _rows_of_calls(here: Any, there: Any, against: str) -> list[Row]:
    wakes, old_wakes = here["wake_ups"], there["wake_ups"]
    return [
        _row(
            "TASK_MOVE turn, calls, Python and C", _all(here["turn"]), _all(there["turn"]), against
        ),
        _row(
            "TASK_MOVE turn, calls, Python", _python(here["turn"]), _python(there["turn"]), against
        ),
        _row_of_wake_up(
            "median", median(map(_python, wakes)), median(map(_python, old_wakes)), against
        ),
        _row_of_wake_up("most", max(map(_python, wakes)), max(map(_python, old_wakes)), against),
    ]


def _row(what: str, ours: float, theirs: float, against: str) -> Row:
    return _counted(what, ours, theirs, against, GOAL_CALLS)


def _row_of_wake_up(which: str, ours: float, theirs: float, against: str) -> Row:
    what = f"idle wake-up, calls, Python, {which} in 10 s"
    return _counted(what, ours, theirs, against, GOAL_WAKE_UP)


def _counted(what: str, ours: float, theirs: float, against: str, goal: int) -> Row:
    return Row(
        what,
        f"{ours:.0f}",
        f"{theirs:.0f} {against[:8]}",
        f"{ours / theirs:.0%}",
        f"≤ {goal}",
        ours <= goal,
    )


def _row_of_cpu(times: Sequence[tuple[float, float]], against: str) -> Row:
    ours, theirs = (median(column) for column in zip(*times, strict=True))
    ratio = median(other / own for own, other in times)
    spread = sorted(other / own for own, other in times)
    return Row(
        f"TASK_MOVE turn, processor, median of {len(times)}",
        f"{ours * 1e6:.1f} µs",
        f"{theirs * 1e6:.1f} µs {against[:8]}",
        f"{ratio:.2f}× less ({spread[0]:.2f}–{spread[-1]:.2f})",
        f"≥ {GOAL_CPU:.0f}×",
        ratio >= GOAL_CPU,
    )


def _most_called(here: Any, names: int) -> Iterator[str]:
    wakes: Counter[str] = Counter()
    for each in here["wake_ups"]:
        wakes.update(each["python"])
    count = len(here["wake_ups"])
    for title, calls, share in (
        ("calls of a TASK_MOVE turn", Counter(here["turn"]["python"]), 1),
        (f"calls of an idle wake-up, on average over {count}", wakes, count),
    ):
        if names:
            yield title
        for name, number in calls.most_common(names or None) if names else ():
            yield f"{number / share:6.1f}  {name}"


def _python(said: Any) -> int:
    return int(sum(said["python"].values()))


def _all(said: Any) -> int:
    return _python(said) + int(sum(said["c"].values()))
