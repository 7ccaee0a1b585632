"""The GCS failsafe: it watches the heartbeats of one ground station (SYSID_MYGCS).

Off by default, as on the real one. Only heartbeats count as a sign of life, setpoints do not.
"""

from rover_sim.parameters import Parameters


class OperatorFailsafe:
    """Trips when heartbeats stop; a rover that never received one does not miss them."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._last_heard: float | None = None
        self.tripped = False

    def __repr__(self) -> str:
        return f"OperatorFailsafe(tripped={self.tripped})"

    def hear_heartbeat(self, system_id: int, *, now: float) -> None:
        """Note a heartbeat from any system."""
        if system_id == self._parameters["SYSID_MYGCS"]:
            self._last_heard = now

    def changed(self, *, now: float) -> bool:
        """Check the time-out; return True once when it trips and once when it clears."""
        if self._parameters["FS_GCS_ENABLE"] == 0 or self._last_heard is None:
            lost = False
        else:
            limit = self._parameters["FS_GCS_TIMEOUT"] + self._parameters["FS_TIMEOUT"]
            lost = now - self._last_heard > limit
        changed = lost is not self.tripped
        self.tripped = lost
        return changed
