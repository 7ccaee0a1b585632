"""What waits until an event is durable: acknowledgements, each with its time limit."""

from collections import deque
from math import inf
from typing import NamedTuple

from mav_tasks.engine.timers import Effect, Timers, Turn


class _Held(NamedTuple):
    number: int  # of the event that must be durable first
    give_up_at: float
    release: Effect
    give_up: Effect


class CommitGate:
    """Effects in the order of the events that they wait for."""

    def __init__(self, timers: Timers) -> None:
        self._held: deque[_Held] = deque()
        self._timer = timers.timer(Turn.SUBMISSIONS, self._give_up)

    def __len__(self) -> int:
        return len(self._held)

    def hold(
        self,
        number: int,
        *,
        give_up_at: float,
        release: Effect,
        give_up: Effect,
    ) -> None:
        """Call ``release`` once event ``number`` is durable, or ``give_up`` if too late."""
        if not self._held:
            self._timer.set(give_up_at)
        self._held.append(_Held(number, give_up_at, release, give_up))

    def committed(self, through: int, *, now: float) -> None:
        """Release all that waited for events up to ``through``."""
        while self._held and self._held[0].number <= through:
            self._held.popleft().release(now=now)
        self._plan()

    def _give_up(self, *, now: float) -> None:
        """Give up what has waited too long."""
        while self._held and self._held[0].give_up_at <= now:
            self._held.popleft().give_up(now=now)
        self._plan()

    def _plan(self) -> None:
        self._timer.set(self._held[0].give_up_at if self._held else inf)
