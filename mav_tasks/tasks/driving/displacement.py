"""Finds suspended tasks whose vehicle was driven far away during a takeover.

Another task may leave the vehicle anywhere, but their client knows the way between the two tasks.
Nobody knows what lies between a task's line and a place reached under manual control.
"""

from collections.abc import Iterable

from mav_tasks.tasks.driving.legs import distance
from mav_tasks.tasks.driving.recovery_path import is_off_line
from mav_tasks.tasks.task import Pose, Task, TaskId
from mav_tasks.tasks.view import VehicleView

LED_AWAY = 2.0  # m from where the vehicle was taken over: more than it takes to brake


class LedAway:
    """Record of one vehicle's takeovers."""

    def __init__(self) -> None:
        self._taken_over_at: Pose | None = None
        self._tasks: set[TaskId] = set()

    def taken_over(self, at: Pose | None) -> None:
        """Note where the vehicle was taken over."""
        if self._taken_over_at is None:
            self._taken_over_at = at

    def given_back(self, seen: VehicleView, aside: Iterable[TaskId]) -> None:
        """Note that the vehicle is ours again; ``aside`` are the tasks that are still suspended."""
        at, self._taken_over_at = self._taken_over_at, None
        if at is None or seen.motion is None:
            return
        if distance(seen.motion.pose, at) > LED_AWAY:
            self._tasks.update(aside)

    def from_line_of(self, task: Task, seen: VehicleView) -> bool:
        """Return whether a takeover displaced the vehicle from a resuming task; True only once."""
        was_led_away = task.id in self._tasks
        self._tasks.discard(task.id)
        return was_led_away and seen.motion is not None and is_off_line(task, seen.motion.pose)
