"""TASK_STATUS to one client: what is due to be told, coalesced when it is too much at once.

Pushed on each state change, and streamed for active tasks at the interval that the client asked
for. It keeps ids only; what is sent is the state at the time of sending.
"""

from mav_tasks.services.statustext import RateLimit

BURST = 20
MOST = 1000  # tasks whose news waits to be told to one client
SHORTEST = 0.05  # s between reports of one task to one client


class TaskStatusSender:
    """Which tasks' states one client is still to be told."""

    def __init__(self, *, rate: float, now: float) -> None:
        self._limit = RateLimit(rate=rate, burst=BURST, now=now)
        self._wait = 1.0 / rate
        self._changed: dict[int, None] = {}  # an ordered set
        self._interval: float | None = None
        self._next_stream_at = now
        self._retry_at = 0.0

    def changed(self, task_id: int) -> None:
        """Note that a task's state changed; telling it twice before it is sent counts once."""
        self._changed[task_id] = None
        if len(self._changed) > MOST:  # the oldest news; a request still shows that task
            del self._changed[next(iter(self._changed))]

    def set_interval(self, interval: float | None, *, now: float) -> None:
        """Stream active tasks every ``interval`` seconds; None: not at all."""
        self._interval = None if interval is None else max(interval, SHORTEST)
        self._next_stream_at = now

    @property
    def interval(self) -> float | None:
        """The interval of the stream, seconds."""
        return self._interval

    def next_deadline(self) -> float | None:
        """Give when ``due`` has something to give."""
        deadlines = []
        if self._changed:
            deadlines.append(self._retry_at)
        if self._interval is not None:
            deadlines.append(self._next_stream_at)
        return min(deadlines, default=None)

    def due(self, active: list[int], *, now: float) -> list[int]:
        """Give the tasks to report now; ``active`` are those that a stream reports."""
        due: dict[int, None] = {}
        while self._changed and now >= self._retry_at:
            if not self._limit.take(now=now):
                self._retry_at = now + self._wait
                break
            task_id = next(iter(self._changed))
            del self._changed[task_id]
            due[task_id] = None
        if self._interval is not None and now >= self._next_stream_at:
            self._next_stream_at = max(self._next_stream_at + self._interval, now)
            due.update(dict.fromkeys(active))
        return list(due)
