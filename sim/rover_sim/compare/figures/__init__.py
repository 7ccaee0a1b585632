"""All figures of a trace, in the order of the manoeuvres."""

from rover_sim.compare.figure import Figure
from rover_sim.compare.figures import (
    driving,
    endings,
    estimate,
    places,
    standing,
    start,
    sticks,
    turning,
)
from rover_sim.compare.trace import Trace

PARTS = (
    start.figures,
    standing.figures,
    estimate.figures,
    driving.figures,
    turning.figures,
    endings.figures,
    sticks.figures,
    places.figures,
)


def figures_of(trace: Trace) -> list[Figure]:
    """Return every figure of the trace, except for manoeuvres that were not driven."""
    return [figure for part in PARTS for figure in part(trace)]
