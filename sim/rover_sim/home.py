"""Home: its position, and when it moves by itself, as on the real autopilots.

From the sources of ArduPilot Rover 4.6 (commands.cpp, update_home) and PX4 1.17 (HomePosition.cpp):
while disarmed, home follows the rover. DO_SET_HOME fixes it: on ArduPilot in either form, until a
restart; on PX4 only with a place, not with "here". ArduPilot sends HOME_POSITION whenever home
moves, PX4 only as it streams it. Not imitated: PX4 forgets such a place when it corrects home's
altitude, by more than 1 m and within 120 s of an arming.
"""

import math
from dataclasses import dataclass

from rover_sim.estimate import Estimate
from rover_sim.setpoints import Destination

LOOK = 1.0  # s between checks; ArduPilot's one_second_loop. PX4 checks in every loop


@dataclass(frozen=True, slots=True)
class HomeRule:
    """Conditions in which one make moves home."""

    where_armed: bool  # sets home at each arming
    least_move: float  # m; while disarmed, home follows a rover that is at least this far away
    here_is_kept: bool  # DO_SET_HOME with "here" also fixes home
    is_told: bool  # HOME_POSITION is sent when home moves


class Follower:
    """Moves home after a disarmed rover."""

    def __init__(self, rule: HomeRule) -> None:
        self._rule = rule
        self._looked_at = float("-inf")
        self.is_kept = False  # a person has set it

    def __repr__(self) -> str:
        return f"Follower(is_kept={self.is_kept})"

    @property
    def follows_arming(self) -> bool:
        """Whether arming sets home."""
        return self._rule.where_armed and not self.is_kept

    def name(self, *, here: bool) -> None:
        """Note that a person has set home."""
        self.is_kept = self._rule.here_is_kept or not here

    def moved(self, home: Destination, estimate: Estimate, *, now: float) -> Destination:
        """Return the new home of a disarmed rover."""
        if self.is_kept or now - self._looked_at < LOOK:
            return home
        self._looked_at = now
        distance = math.hypot(estimate.north - home.north, estimate.east - home.east)
        if distance < self._rule.least_move:
            return home
        return Destination(estimate.north, estimate.east)
