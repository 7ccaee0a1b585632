"""TASK_STATUS to one client: what is due to be told, coalesced when it is too much at once.

Pushed on each state change, and streamed for active tasks at the interval that the client asked
for. It keeps ids only; what is sent is the state at the time of sending.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from math import inf

from mav_tasks.latest import shorten
from mav_tasks.services.message_interval import LONGEST_US
from mav_tasks.services.token_bucket import TokenBucket

BURST = 20
MOST = 1000  # tasks whose news waits to be told to one client
SHORTEST = 0.05  # s between reports of one task to one client
LONGEST = LONGEST_US / 1e6  # s; a longer one could not be told


@dataclass(slots=True)
class _Stream:
    interval: float  # s
    next_at: float


class TaskStatusSender:
    """Which tasks' states one client is still to be told."""

    def __init__(self, *, rate: float, wake: Callable[[float], None], now: float) -> None:
        """``wake`` is called with the time at which ``due`` has something to give."""
        self._wake = wake
        self._limit = TokenBucket(rate=rate, burst=BURST, now=now)
        self._changed: dict[int, None] = {}  # an ordered set
        self._streams: dict[int, _Stream] = {}  # by vehicle
        self._retry_at = 0.0

    def apply(self, *, rate: float) -> None:
        self._limit.apply(rate=rate)

    def changed(self, task_id: int) -> None:
        """Note that a task's state changed; telling it twice before it is sent counts once."""
        self._changed[task_id] = None
        shorten(self._changed, MOST)  # a request still shows those tasks
        self._wake(self._retry_at)

    def set_interval(self, vehicle: int, interval: float | None, *, now: float) -> None:
        """Stream a vehicle's active task every ``interval`` seconds; None: not at all."""
        if interval is None:
            self._streams.pop(vehicle, None)
        else:
            self._streams[vehicle] = _Stream(min(max(interval, SHORTEST), LONGEST), now)
        self._wake(now)

    def forget(self, vehicle: int, tasks: Collection[int]) -> None:
        """Forget a vehicle with its ``tasks``."""
        self._streams.pop(vehicle, None)
        self._changed = {each: None for each in self._changed if each not in tasks}

    def interval(self, vehicle: int) -> float | None:
        """Return the interval of a vehicle's stream, seconds; None: there is none."""
        stream = self._streams.get(vehicle)
        return None if stream is None else stream.interval

    def next_deadline(self) -> float:
        """Return when ``due`` has something to give; inf: never, as things are."""
        first = self._retry_at if self._changed else inf
        if not self._streams:  # as with nearly all clients
            return first
        return min([first, *(stream.next_at for stream in self._streams.values())])

    def due(self, active: Mapping[int, int], *, now: float) -> list[int]:
        """Return the tasks to report now; ``active`` are those that streams report, by vehicle."""
        due: dict[int, None] = {}
        while self._changed and now >= self._retry_at:
            if not self._limit.take(now=now):
                self._retry_at = now + 1.0 / self._limit.rate
                break
            task_id = next(iter(self._changed))
            del self._changed[task_id]
            due[task_id] = None
        for vehicle, stream in self._streams.items():
            if now >= stream.next_at:
                stream.next_at = max(stream.next_at + stream.interval, now)
                if vehicle in active:
                    due[active[vehicle]] = None
        return list(due)
