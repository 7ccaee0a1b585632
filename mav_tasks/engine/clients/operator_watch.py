"""Whether the people are still there: heartbeats of ground stations, all of them together."""

from math import inf

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavType


class OperatorWatch:
    """When a ground station was last heard; a script that sends no heartbeat is none."""

    def __init__(self) -> None:
        self._heard_at: float | None = None  # None: there is none, or its loss was told

    def __repr__(self) -> str:
        return f"OperatorWatch(heard at {self._heard_at})"

    def receive(self, heartbeat: m.Heartbeat, *, now: float) -> None:
        """Take a client's heartbeat in."""
        if heartbeat.type == MavType.GCS:
            self._heard_at = now

    def next_deadline(self, *, limit: float) -> float:
        """Give when the last ground station has been silent for ``limit`` seconds; inf: never."""
        return inf if self._heard_at is None else self._heard_at + limit

    def has_lost(self, *, limit: float, now: float) -> bool:
        """Whether that is so; said once."""
        is_lost = now >= self.next_deadline(limit=limit)
        if is_lost:
            self._heard_at = None
        return is_lost
