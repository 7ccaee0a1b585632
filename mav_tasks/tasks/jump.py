"""Whether a measured position has moved further than its vehicle can have driven."""

from mav_tasks.tasks.guidance import Motion

JUMP = 2.0  # m, beyond what the vehicle can have driven meanwhile


class JumpWatch:
    """The last position of one vehicle."""

    def __init__(self) -> None:
        self._last: Motion | None = None

    @property
    def last(self) -> Motion | None:
        """Where it was at the last look."""
        return self._last

    def has_jumped(self, motion: Motion | None, *, max_speed: float) -> bool:
        """Look at the present position; whether nobody can have driven there, at m/s."""
        last = self._last
        if motion is None or motion is last:
            return False
        self._last = motion
        if last is None:
            return False
        elapsed = max(0.0, motion.at - last.at)
        north = motion.pose.north - last.pose.north
        east = motion.pose.east - last.pose.east
        reach = JUMP + 2 * max_speed * elapsed
        return north * north + east * east > reach * reach
