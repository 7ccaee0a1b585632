"""The same words again and again are said once, then counted. Pure; times in seconds as ``now``.

The rule: words that were said less than WINDOW ago are not said but counted. When the window is
over, they are said once more with their count, and the next window begins; without a count they
are forgotten.
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

WINDOW = 30.0  # s
MOST = 1_000  # different words remembered; beyond, the oldest are done with early

T = TypeVar("T")


@dataclass(slots=True)
class Said(Generic[T]):
    """What was said at ``since``, and how often again since then."""

    what: T
    since: float
    more: int = 0


class Repeats(Generic[T]):
    """Remembers what was said. What ``due`` and ``rest`` give is to be said with its count."""

    def __init__(self) -> None:
        self._said: OrderedDict[Hashable, Said[T]] = OrderedDict()  # the oldest first

    def __repr__(self) -> str:
        return f"Repeats({len(self._said)} remembered)"

    def is_new(self, key: Hashable, what: T, *, now: float) -> bool:
        """Whether ``what`` is to be said; otherwise it is counted."""
        said = self._said.get(key)
        if said is None:
            self._said[key] = Said(what, now)
            return True
        said.more += 1
        said.what = what
        return False

    def due(self, *, now: float) -> Iterator[tuple[Said[T], float]]:
        """Yield what was repeated in a window that is over, with the length of that window."""
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
        """Yield all that was repeated and not said yet: nothing comes any more."""
        while self._said:
            _, said = self._said.popitem(last=False)
            if said.more:
                yield said, now - said.since
