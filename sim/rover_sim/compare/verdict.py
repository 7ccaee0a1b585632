"""Decides whether a simulated figure is close enough to the real one."""

from dataclasses import dataclass
from enum import Enum

from rover_sim.compare.explained import explanation_of
from rover_sim.compare.figure import Figure, Value
from rover_sim.compare.pairs import Pair
from rover_sim.compare.reference import reference_of

FACTOR = 1.5  # either way


class Verdict(Enum):
    """Result of comparing a simulated figure with the real one."""

    OK = "ok"
    EXPLAINED = "EXPLAINED"  # differs on purpose; a sentence gives the reason
    DIFFERS = "DIFFERS"


@dataclass(frozen=True, slots=True)
class Comparison:
    """One figure, real and simulated."""

    figure: Figure  # of the simulated rover
    real: Value
    verdict: Verdict
    why: str = ""  # of EXPLAINED

    @property
    def ratio(self) -> float | None:
        """Simulated divided by real, or None if that is meaningless."""
        real, simulated = self.real, self.figure.value
        if isinstance(real, str) or isinstance(simulated, str) or not real or simulated is None:
            return None
        return simulated / real


def compare(pair: Pair, figures: list[Figure]) -> list[Comparison]:
    """Compare each figure that the real rover has."""
    real = reference_of(pair)
    return [_compare(pair, figure, real[figure.key]) for figure in figures if figure.key in real]


def missing(pair: Pair, figures: list[Figure]) -> list[tuple[str, str]]:
    """Return the real figures that the simulated rover lacks, because it skipped a manoeuvre."""
    found = {figure.key for figure in figures}
    return [key for key in reference_of(pair) if key not in found]


def _compare(pair: Pair, figure: Figure, real: Value) -> Comparison:
    if is_near(real, figure.value, floor=figure.scale.floor):
        return Comparison(figure, real, Verdict.OK)
    explanation = explanation_of(pair, figure)
    if explanation is not None:
        return Comparison(figure, real, Verdict.EXPLAINED, explanation.why)
    return Comparison(figure, real, Verdict.DIFFERS)


def is_near(real: Value, simulated: Value, *, floor: float) -> bool:
    """Return whether two values are within a factor of 1.5, or both within ± floor."""
    if real is None or simulated is None or isinstance(real, str) or isinstance(simulated, str):
        return real == simulated
    if abs(real) <= floor and abs(simulated) <= floor:
        return True
    if real * simulated <= 0.0:
        return real == simulated
    return 1.0 / FACTOR <= simulated / real <= FACTOR
