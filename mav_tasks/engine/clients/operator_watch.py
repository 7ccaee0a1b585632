"""Detects that no ground station is heard any more: the heartbeats of all of them count."""

from math import inf

from mav_tasks.engine.timers import Effect, Timers, Turn
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavType
from mav_tasks.settings import Settings


class OperatorWatch:
    """The watch on ground stations' heartbeats (MAV_TYPE_GCS)."""

    def __init__(self, timers: Timers, lost: Effect, settings: Settings) -> None:
        """``lost`` is called once when all ground stations have been silent for too long."""
        self._heard_at = inf  # inf: none was heard, or its loss was reported
        self._lost = lost
        self._timer = timers.timer(Turn.OPERATOR, self._lose)
        self.apply(settings)

    def __repr__(self) -> str:
        return f"OperatorWatch(heard at {self._heard_at})"

    def apply(self, settings: Settings) -> None:
        self._limit = settings.watch.operator_lost
        self._timer.set(self._heard_at + self._limit)

    def receive(self, heartbeat: m.Heartbeat, *, now: float) -> None:
        if heartbeat.type == MavType.GCS:
            self._heard_at = now
            self._timer.set(now + self._limit)

    def _lose(self, *, now: float) -> None:
        self._heard_at = inf
        self._lost(now=now)
