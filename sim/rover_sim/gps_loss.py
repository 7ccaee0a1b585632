"""A rover without satellites: its estimate coasts for some seconds, then it has no position."""

from rover_sim.faults import Faults

COASTS = 5.0  # s, PX4's EKF2_NOAID_TOUT; ArduPilot's EKF gives up after 5 to 10 s


class GpsLoss:
    """Measures the time since the satellites were lost."""

    def __init__(self) -> None:
        self._lost_at: float | None = None
        self.is_position_gone = False

    def __repr__(self) -> str:
        return f"GpsLoss({'no position' if self.is_position_gone else 'position'})"

    def watch(self, faults: Faults, *, now: float) -> bool:
        """Check the time; return True once, when the position is lost."""
        if not faults.gps_lost:
            self._lost_at, self.is_position_gone = None, False
            return False
        if self._lost_at is None:
            self._lost_at = now
        had, self.is_position_gone = not self.is_position_gone, now - self._lost_at >= COASTS
        return had and self.is_position_gone
