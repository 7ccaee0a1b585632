"""The square in which a rover stays while it is probed: about the place where it stood. Pure."""

from dataclasses import dataclass
from math import cos, inf, sin

from mav_tasks.config.settings import Turning
from mav_tasks.kinds import Pose
from mav_tasks.kinds.guidance import Motion
from mav_tasks.kinds.path import cross_track, forward_of

HALF = 1.0  # m, from the middle to each side: the area measures 2 m
#: m, the same for one that steers as a car: it has to come out of its turning circle, of 1.5 m and
#: more, and needs more way to come to a speed
HALF_OF_CAR = 4.0
AHEAD = 0.5  # s, in which a slow rover can stop: where it would be then must still be inside


@dataclass(frozen=True, slots=True)
class DrivingArea:
    """A square whose sides run along the heading that the rover had."""

    middle: Pose
    half: float = HALF

    @classmethod
    def about(cls, middle: Pose, *, turning: str, radius: float | None) -> "DrivingArea":
        """Return the area for one that turns so; ``turning`` is the value of a Turning."""
        if turning != Turning.STEERED.value:
            return cls(middle)
        return cls(middle, max(HALF_OF_CAR, 3.0 * (radius or 0.0)))

    def place_of(self, pose: Pose) -> tuple[float, float]:
        """Return where a pose is, metres ahead of and to the right of the middle."""
        return forward_of(self.middle, pose), cross_track(self.middle, pose)

    def holds(self, motion: Motion) -> bool:
        """Whether a rover is inside, and would be if it began to stop now."""
        ahead, right = self.place_of(motion.pose)
        turn = motion.pose.yaw - self.middle.yaw
        speed_ahead = motion.forward * cos(turn) - motion.sideways * sin(turn)
        speed_right = motion.forward * sin(turn) + motion.sideways * cos(turn)
        places = (ahead, right, ahead + AHEAD * speed_ahead, right + AHEAD * speed_right)
        return all(abs(place) <= self.half for place in places)

    def room(self, pose: Pose, course: float) -> float:
        """Return the metres from a place inside to a side, in a direction (rad from north)."""
        turn = course - self.middle.yaw
        rooms = [
            (self.half - at * (1 if step > 0 else -1)) / abs(step)
            for at, step in zip(self.place_of(pose), (cos(turn), sin(turn)), strict=True)
            if abs(step) > 1e-9
        ]
        return max(min(rooms, default=inf), 0.0)
