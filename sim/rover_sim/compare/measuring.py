"""Measure a simulated rover: several runs with different seeds, and their medians."""

import statistics
from collections import Counter
from dataclasses import replace

from rover_sim.compare.figure import Figure, Value
from rover_sim.compare.figures import figures_of
from rover_sim.compare.manoeuvres import drive_all
from rover_sim.compare.pairs import Pair, make_rover
from rover_sim.compare.virtual_driver import VirtualDriver

RUNS = 5  # a single run could deviate by chance as much as a recording


def measure(pair: Pair, *, seed: int, runs: int = RUNS) -> list[Figure]:
    """Return the figures of a simulated rover, each the median of all runs."""
    drives = [_drive(pair, seed=seed + run) for run in range(runs)]
    return [
        replace(same[0], value=middle([figure.value for figure in same]))
        for same in zip(*drives, strict=True)
    ]


def middle(values: list[Value]) -> Value:
    """Return the median of numbers; for words, or if some are None, the most frequent value."""
    numbers = [value for value in values if isinstance(value, (int, float))]
    if len(numbers) == len(values):
        return statistics.median(numbers)
    return Counter(values).most_common(1)[0][0]


def _drive(pair: Pair, *, seed: int) -> list[Figure]:
    vehicle = make_rover(pair, seed=seed)
    driver = VirtualDriver(vehicle)
    drive_all(driver)
    vehicle.body.close()
    return figures_of(driver.trace)
