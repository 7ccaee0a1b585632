"""Breadth-first search through the states of a vehicle's control: every deed from each."""

import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.kit.joint.deeds import BY_NAME, DEEDS, Scene
from tests.kit.joint.forks import Forks
from tests.kit.joint.judge import WAY_OUT, Judge, Report, State
from tests.kit.world import World


@dataclass
class Found:
    """The result of a search."""

    #: each state, with the deeds that lead to it
    states: dict[State, tuple[str, ...]] = field(default_factory=dict)
    attempts: int = 0
    #: deeds from the start, with the problem at their end
    wrong: list[tuple[tuple[str, ...], str]] = field(default_factory=list)
    #: states from which not every deed was tried when the search ended
    left: int = 0

    def __str__(self) -> str:
        deepest = max(map(len, self.states.values()), default=0)
        return (
            f"{len(self.states)} states, up to {deepest} deeds away, {self.attempts} deeds tried,"
            f" {self.left} states left, {len(self.wrong)} wrong"
        )


def search(
    make: Callable[[], World], *, most: int, start: Sequence[str] = (), way_out: bool = True
) -> Found:
    """Try every deed from up to ``most`` reachable states.

    ``start`` are the names of deeds that lead to the first state.
    """
    found = Found()
    judge = Judge(Scene(make()))
    for name in start:
        _note(found, tuple(start), judge.do(DEEDS.index(BY_NAME[name])))
    first = judge.state()
    found.states[first] = tuple(start)
    with tempfile.TemporaryDirectory() as folder:
        forks = Forks(Path(folder), judge.do)
        try:
            waiting = deque([(0, first)])
            tried = 0
            while waiting and tried < most:
                tried += 1
                number, state = waiting.popleft()
                path = found.states[state]
                if way_out:
                    copy, report = forks.attempt(number, WAY_OUT)
                    forks.decide(copy, keep=False)
                    _note(found, (*path, "the way out"), report)
                for deed in range(len(DEEDS)):
                    copy, report = forks.attempt(number, deed)
                    found.attempts += 1
                    there = (*path, DEEDS[deed].name)
                    is_wrong = _note(found, there, report)
                    is_new = not is_wrong and report.state not in found.states
                    if is_new:
                        found.states[report.state] = there
                        waiting.append((copy, report.state))
                    forks.decide(copy, keep=is_new)
            found.left = len(waiting)
        finally:
            forks.close()
    return found


def _note(found: Found, path: tuple[str, ...], report: Report | BaseException) -> bool:
    if isinstance(report, BaseException):
        found.wrong.append((path, repr(report)))
        return True
    found.wrong += [(path, each) for each in report.wrong]
    return bool(report.wrong)
