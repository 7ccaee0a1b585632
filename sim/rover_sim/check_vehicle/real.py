"""The figures of real rovers beside those of the simulated ones, and the verdict on each.

Recorded in November 2026, in real time, in the same manoeuvres: ArduPilot Rover 4.6.3 SITL, true
pose from SIM_STATE; PX4 1.17.0 SITL, a kinematic differential rover in lock-step and the Ackermann
rover of its SIH. All settings at their defaults (the differential rover: RO_SPEED_LIM 1.8,
RO_MAX_THR_SPEED 2, RO_ACCEL_LIM 4, RO_DECEL_LIM 6, RO_JERK_LIM 10, RO_YAW_RATE_LIM 250,
RO_YAW_P 5), no radio, one ground station. real.csv has them; a dash: it did not happen or was never
sent; empty: not driven; in texts # replaces a number. explained.csv has the differences that are
meant or cannot be helped, each for a range of simulated values, so that it hides no change.
"""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from fnmatch import fnmatchcase
from pathlib import Path

from rover_sim.check_vehicle.figures import Value

FACTOR = 1.5  # either way
NOTHING = "–"
HERE = Path(__file__).parent


class Verdict(Enum):
    """Result of comparing a simulated figure with the real one."""

    OK = "ok"
    EXPLAINED = "EXPLAINED"  # differs on purpose; a sentence gives the reason
    DIFFERS = "DIFFERS"


@dataclass(frozen=True, slots=True)
class Comparison:
    """One figure, real and simulated."""

    group: str
    name: str
    unit: str
    real: Value
    simulated: Value
    verdict: Verdict
    why: str = ""

    def __str__(self) -> str:
        name = f"{self.group}: {self.name}, {self.unit}".removesuffix(", ")
        verdict = self.verdict.value + (f": {self.why}" if self.why else "")
        return f"{name:<72} {_shown(self.real):>10} {_shown(self.simulated):>10}  {verdict}"


def compare(rover: str, figures: Mapping[tuple[str, str], Value]) -> Iterator[Comparison]:
    """Yield each figure that the real rover of this name has."""
    for row in _rows("real.csv"):
        if not row[rover]:
            continue
        group, name, real = row["group"], row["figure"], _value(row[rover])
        simulated = figures.get((group, name), "not measured")
        verdict, why = Verdict.OK, ""
        if not is_near(real, simulated, floor=float(row["floor"])):
            why = _explanation(rover, group, name, simulated)
            verdict = Verdict.EXPLAINED if why else Verdict.DIFFERS
        yield Comparison(group, name, row["unit"], real, simulated, verdict, why)


def is_near(real: Value, simulated: Value, *, floor: float) -> bool:
    """Return whether two values are within a factor of 1.5, or both within ± floor."""
    if real is None or simulated is None or isinstance(real, str) or isinstance(simulated, str):
        return real == simulated
    if abs(real) <= floor and abs(simulated) <= floor:
        return True
    if real * simulated <= 0.0:
        return real == simulated
    return 1.0 / FACTOR <= simulated / real <= FACTOR


def _explanation(rover: str, group: str, name: str, value: Value) -> str:
    for row in _rows("explained.csv"):
        texts = zip((rover, group, name), (row["rovers"], row["group"], row["figure"]), strict=True)
        if all(fnmatchcase(*each) for each in texts):
            least, most = _value(row["least"]), _value(row["most"])
            if isinstance(least, float) and isinstance(most, float):
                if isinstance(value, int | float) and least <= value <= most:
                    return row["why"]
            elif value == least:
                return row["why"]
    return ""


def _rows(name: str) -> list[dict[str, str]]:
    with (HERE / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def _value(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return None if text == NOTHING else text


def _shown(value: Value) -> str:
    if value is None:
        return NOTHING
    return value if isinstance(value, str) else f"{value:.3f}"
