"""The operator-lost failsafe: heartbeats of the one ground station that counts (SYSID_MYGCS).

Off by default, as in the real one. Setpoints are no sign of life, only heartbeats are.
"""

from rover_sim.parameters import Parameters


class OperatorFailsafe:
    """Trips when heartbeats stop; a rover that never heard one does not miss them."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._last_heard: float | None = None
        self.tripped = False

    def __repr__(self) -> str:
        return f"OperatorFailsafe(tripped={self.tripped})"

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat of any system."""
        if system_id == self._parameters["SYSID_MYGCS"]:
            self._last_heard = now

    def changed(self, *, now: float) -> bool:
        """Look at the clock; True once when it trips and once when it clears."""
        if self._parameters["FS_GCS_ENABLE"] == 0 or self._last_heard is None:
            lost = False
        else:
            limit = self._parameters["FS_GCS_TIMEOUT"] + self._parameters["FS_TIMEOUT"]
            lost = now - self._last_heard > limit
        changed = lost is not self.tripped
        self.tripped = lost
        return changed
