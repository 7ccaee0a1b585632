"""PX4's OFFBOARD: whether setpoints stream, and the last one."""

from rover_sim.px4_setpoints import Setpoint
from rover_sim.setpoints import Target

STREAM_GAP = 0.5  # s, longest gap between two setpoints: PX4's guide asks for 2 Hz


class Offboard:
    """Counts setpoints in any mode; keeps the last one that came in OFFBOARD."""

    def __init__(self) -> None:
        self.target: Target | None = None
        self.speed: float | None = None  # m/s towards a place, if the setpoint has one
        self._last: float | None = None
        self._gap: float | None = None  # s between the last two

    def __repr__(self) -> str:
        return f"Offboard({self.target})"

    def hear(self, *, now: float) -> None:
        """Count a setpoint."""
        self._gap = None if self._last is None else now - self._last
        self._last = now

    def follow(self, setpoint: Setpoint) -> None:
        """Store the target of a setpoint."""
        self.target, self.speed = setpoint

    def is_streaming(self, *, now: float) -> bool:
        """Return whether setpoints stream: at least two came, and the last one recently."""
        return (
            self._gap is not None
            and self._gap <= STREAM_GAP
            and self.silence(now=now) <= STREAM_GAP
        )

    def silence(self, *, now: float) -> float:
        """Return the seconds since the last setpoint; infinity if there was none."""
        return float("inf") if self._last is None else now - self._last
