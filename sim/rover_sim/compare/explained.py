"""Figures that differ from the real ones on purpose, or of necessity: each with the reason.

An explanation covers a range of simulated values and no more, so that it cannot hide a change.
"""

from dataclasses import dataclass
from fnmatch import fnmatchcase

from rover_sim.compare.figure import Figure, Value
from rover_sim.compare.pairs import Pair


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why some figures of some rovers differ."""

    rovers: str  # a pattern of the pair's name
    group: str  # a pattern
    name: str  # a pattern
    between: tuple[float, float] | str | None  # what the simulated value may be
    why: str

    def covers(self, pair: Pair, figure: Figure) -> bool:
        """Return whether it is about this figure, with the value that it has."""
        return self.is_about(pair, *figure.key) and self._allows(figure.value)

    def is_about(self, pair: Pair, group: str, name: str) -> bool:
        """Return whether it is about the figure of that group and name."""
        return (
            fnmatchcase(pair.name, self.rovers)
            and fnmatchcase(group, self.group)
            and fnmatchcase(name, self.name)
        )

    def _allows(self, value: Value) -> bool:
        if isinstance(self.between, tuple):
            low, high = self.between
            return isinstance(value, (int, float)) and low <= value <= high
        return value == self.between


EXPLANATIONS: tuple[Explanation, ...] = ()


def explanation_of(pair: Pair, figure: Figure) -> Explanation | None:
    """Return why this figure may differ; None: there is no reason."""
    return next((each for each in EXPLANATIONS if each.covers(pair, figure)), None)
