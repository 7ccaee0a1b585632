"""The figures of the real rovers, for comparison with the simulated ones.

ArduPilot Rover 4.6.3 SITL, vehicles ``rover-skid`` and ``rover``, true pose from SIM_STATE; PX4
1.17.0 SITL, a kinematic differential rover in lock-step and the Ackermann rover of its SIH. All
settings at their defaults (the differential rover: RO_SPEED_LIM 1.8, RO_MAX_THR_SPEED 2,
RO_ACCEL_LIM 4, RO_DECEL_LIM 6, RO_JERK_LIM 10, RO_YAW_RATE_LIM 250, RO_YAW_P 5), no radio, one
ground station. Recorded in November 2026, real time, through the same manoeuvres.
"""

from rover_sim.compare.figure import Value
from rover_sim.compare.pairs import PAIRS, Pair
from rover_sim.compare.reference_driving import DRIVING
from rover_sim.compare.reference_reports import REPORTS
from rover_sim.compare.reference_row import NOT_DRIVEN

Key = tuple[str, str]  # group and name of a figure


def reference_of(pair: Pair) -> dict[Key, Value]:
    """Return the real rover's figures, by group and name, without those that it did not drive."""
    column = PAIRS.index(pair)
    return {
        (group, name): values[column]
        for group, rows in {**REPORTS, **DRIVING}.items()
        for name, values in rows.items()
        if values[column] != NOT_DRIVEN
    }
