"""Which tasks that were set aside somebody else has meanwhile driven the vehicle far from.

Another task may leave the vehicle anywhere: who queued both knows the way between them. What lies
between here and a place that somebody drove to by hand nobody knows.
"""

from collections.abc import Iterable
from math import hypot

from mav_tasks.tasks.driving.recovery_path import is_off_line
from mav_tasks.tasks.task import Pose, Task, TaskId
from mav_tasks.tasks.view import VehicleView

LED_AWAY = 2.0  # m from where somebody took the vehicle over: more than it takes to brake


class LedAway:
    """The memory of takeovers of one vehicle."""

    def __init__(self) -> None:
        self._taken_over_at: Pose | None = None
        self._tasks: set[TaskId] = set()

    def taken_over(self, at: Pose | None) -> None:
        """Somebody takes the vehicle over here."""
        if self._taken_over_at is None:
            self._taken_over_at = at

    def given_back(self, seen: VehicleView, aside: Iterable[TaskId]) -> None:
        """It is ours again; these tasks are still set aside."""
        at, self._taken_over_at = self._taken_over_at, None
        if at is None or seen.motion is None:
            return
        here = seen.motion.pose
        if hypot(here.north - at.north, here.east - at.east) > LED_AWAY:
            self._tasks.update(aside)

    def from_line_of(self, task: Task, seen: VehicleView) -> bool:
        """Whether a task that is to go on now would begin with a way that nobody has seen."""
        was_led_away = task.id in self._tasks
        self._tasks.discard(task.id)
        return was_led_away and seen.motion is not None and is_off_line(task, seen.motion.pose)
