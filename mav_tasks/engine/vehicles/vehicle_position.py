"""Where a vehicle is, how it moves, where its local frame begins, and where home and fence are."""

from collections.abc import Sequence

from mav_tasks.engine.vehicles.frame_monitor import FrameMonitor
from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.engine.vehicles.sender_clock import Heard, Stamped
from mav_tasks.mavlink.messages import GlobalPositionInt
from mav_tasks.settings import Watch
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.path import distance
from mav_tasks.tasks.frames import local_place
from mav_tasks.tasks.goal import GlobalPlace, GoTo, LocalPlace, Step


class VehiclePosition:
    """The position data of one vehicle, and what follows from it."""

    def __init__(self, watch: Watch, bounds: Bounds) -> None:
        self.motion = MotionMonitor(watch)
        self.frame = FrameMonitor()
        self._bounds = bounds

    def __repr__(self) -> str:
        return f"VehiclePosition({self.motion.latest()}, origin={self.frame.origin})"

    def receive(self, message: Stamped, *, now: float, not_after: float) -> Heard:
        """Process a message and return its classification; an old message is dropped.

        A message that is read late counts as sent at ``not_after`` at the latest.
        """
        if isinstance(message, GlobalPositionInt):
            heard = self.motion.clock.hear(message, now=now)
        else:
            heard = self.motion.receive(message, now=now, not_after=not_after)
        if heard is Heard.NEWS:
            self.frame.boot(self.motion.clock.booted_at(now=now), now=now)
            self.frame.receive(message)
        return heard

    def forget(self) -> None:
        """Forget all position data after a restart of the vehicle."""
        self.motion.forget()
        self.frame.forget()

    @property
    def home(self) -> GlobalPlace | None:
        """The place to which the vehicle returns: the nearest rally point, else its home."""
        motion = self.motion.latest() if self._bounds.rally else None
        rally = None if motion is None else self._bounds.refuge(motion.pose, self.frame.origin)
        return rally or self.frame.home

    @property
    def is_fence_unknown(self) -> bool:
        """Whether there is a fence whose place in the vehicle's frame is unknown."""
        return self._bounds.is_unknown(self.frame.origin)

    def distance_to(self, goal: GoTo) -> float | None:
        """Return the metres to the place of a goal, or None if that is unknown."""
        motion, place = self.motion.latest(), self._place_of(goal)
        return None if motion is None or place is None else distance(motion.pose, place)

    def is_within_fence(self, goal: GoTo) -> bool:
        """Return whether the fence allows the place of a goal; True if that is unknown."""
        fence = self._bounds.local(self.frame.origin)
        if fence is None:
            return True
        place = self._place_of(goal)
        return place is None or fence.allows(place)

    def leg_over_fence(self, steps: Sequence[Step]) -> int | None:
        """Return a step of a plan whose straight line crosses the fence, or None."""
        return self._bounds.forbidden_leg(steps, self.frame.origin)

    def _place_of(self, goal: GoTo) -> LocalPlace | None:
        return local_place(self.home if goal.place is None else goal.place, self.frame.origin)
