"""Detects a jump of a vehicle's position or heading: more than it can have driven or turned."""

from math import radians

from mav_tasks.settings import Driving
from mav_tasks.tasks.driving.guidance import Motion, wrap

JUMP = 2.0  # m beyond the distance that the vehicle can have driven meanwhile
TURN = radians(45)  # rad, the same for the heading


class JumpWatch:
    """Detector of jumps of one vehicle's pose."""

    def __init__(self) -> None:
        #: the motion at the last look
        self.last: Motion | None = None

    def has_jumped(self, motion: Motion | None, *, driving: Driving) -> bool:
        """Return whether the vehicle cannot have got to this pose from the last; remember it."""
        last = self.last
        if motion is None or motion is last:
            return False
        self.last = motion
        if last is None:
            return False
        elapsed = max(0.0, motion.at - last.at)
        north = motion.pose.north - last.pose.north
        east = motion.pose.east - last.pose.east
        reach = JUMP + 2 * driving.max_speed * elapsed
        if abs(wrap(motion.pose.yaw - last.pose.yaw)) > TURN + 2 * driving.max_turn_rate * elapsed:
            return True
        return north * north + east * east > reach * reach
