"""Suppresses and counts repeated messages. Pure; times are seconds, on the clock of ``now``.

The rule: a message that was written less than WINDOW ago is counted instead of written. When the
window is over, a counted message is written once more with its count, and its next window begins;
a message without repetitions is forgotten.
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

WINDOW = 30.0  # s
MOST = 1_000  # messages remembered; beyond, the windows of the oldest end early

T = TypeVar("T")


@dataclass(slots=True)
class Said(Generic[T]):
    """A message written at ``since``, and the number of its repetitions since then."""

    what: T
    since: float
    more: int = 0


class Repeats(Generic[T]):
    """The messages written recently. Callers write those of ``due`` and ``rest`` with counts."""

    def __init__(self) -> None:
        self._said: OrderedDict[Hashable, Said[T]] = OrderedDict()  # the oldest first

    def __repr__(self) -> str:
        return f"Repeats({len(self._said)} remembered)"

    def is_new(self, key: Hashable, what: T, *, now: float) -> bool:
        """Return whether to write ``what``; if not, count it."""
        said = self._said.get(key)
        if said is None:
            self._said[key] = Said(what, now)
            return True
        said.more += 1
        said.what = what
        return False

    def due(self, *, now: float) -> Iterator[tuple[Said[T], float]]:
        """Yield each message with repetitions whose window is over, and the window's length."""
        while self._said:
            key, said = next(iter(self._said.items()))
            if now < said.since + WINDOW and len(self._said) <= MOST:
                return
            del self._said[key]
            if said.more:
                yield said, now - said.since
                if now >= said.since + WINDOW:
                    self._said[key] = Said(said.what, now)

    def rest(self, *, now: float) -> Iterator[tuple[Said[T], float]]:
        """Remove all messages; yield those with repetitions. Called at the end of the log."""
        while self._said:
            _, said = self._said.popitem(last=False)
            if said.more:
                yield said, now - said.since
