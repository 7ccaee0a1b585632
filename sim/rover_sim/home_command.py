"""DO_SET_HOME, from the sources, not observed. The altitude is ignored: the world is flat."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mav_tasks.mavlink.enums import MavCmd, MavResult
from rover_sim.commands import Action, Command, CommandParts
from rover_sim.setpoints import read_place

HERE = 1.0  # param1
OFF_EARTH = 2**31 - 1, 0


@dataclass(frozen=True, slots=True)
class HomeCommand:
    """Sets home to the rover's position, or to a place."""

    parts: CommandParts
    refusal: MavResult  # of a place that is none
    nowhere_is_here: bool  # 0/0 is the rover's position, not a refusal

    def actions(self) -> Mapping[int, Action]:
        """Return the command table's entry for this command."""
        return {MavCmd.DO_SET_HOME: self._set_home}

    def _set_home(self, command: Command, _now: float) -> MavResult:
        latitude, longitude = command.place or _as_degE7(command.degrees)
        if command.params[0] == HERE or (self.nowhere_is_here and (latitude, longitude) == (0, 0)):
            self.parts.flight.set_home(None)
            return MavResult.ACCEPTED
        place = read_place(latitude, longitude, self.parts.origin)
        if place is None:
            return self.refusal
        self.parts.flight.set_home(place)
        return MavResult.ACCEPTED


def _as_degE7(degrees: tuple[float, float] | None) -> tuple[int, int]:
    """Return the place of a COMMAND_LONG; one off the earth for values that are not finite."""
    if degrees is None or not all(math.isfinite(value) for value in degrees):
        return OFF_EARTH
    return round(degrees[0] * 1e7), round(degrees[1] * 1e7)
