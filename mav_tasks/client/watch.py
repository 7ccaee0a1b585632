"""The tasks that a client follows, and when to request their status. Pure.

The server sends each change unasked. If a caller waits for a task and no status arrives for a
while, a packet was lost or the server restarted: the client then requests the status.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mav_tasks.client.values import TaskStatus

SILENT = 2.0  # s without a status of an active task
MOST_UNHELD = 100  # followed tasks from which on ``shed`` removes those without a handle
SILENT_WAITING = 10.0  # s, at most, for a waiting task


@dataclass(slots=True, eq=False, weakref_slot=True)
class Followed:
    """A followed task. ``status``: None before the first; ``listeners``: coroutines that wait."""

    id: int
    vehicle: int
    status: TaskStatus | None = None
    nonce: int | None = None
    listeners: int = 0
    ask_at: float = 0.0
    patience: float = SILENT
    is_asked: bool = False  # a request for its status is in flight
    is_lost: bool = False

    @property
    def is_over(self) -> bool:
        """Whether no more news will arrive."""
        return self.is_lost or (self.status is not None and self.status.is_over)


class Watch:
    """The followed tasks, and the requested status streams."""

    def __init__(self) -> None:
        self._followed: dict[int, Followed] = {}
        self._streams: dict[int, list[float]] = {}
        self._shed_at = MOST_UNHELD

    def __repr__(self) -> str:
        return f"Watch({list(self._followed)})"

    def follow(self, task_id: int, vehicle: int, *, nonce: int | None, now: float) -> Followed:
        """Follow a task. Return the existing entry if it is followed already."""
        followed = self._followed.get(task_id)
        if followed is None:
            followed = self._followed[task_id] = Followed(task_id, vehicle, nonce=nonce)
            followed.ask_at = now + followed.patience
        return followed

    def shed(self, is_held: Callable[[Followed], bool]) -> None:
        """Remove tasks without a handle or listener; does nothing until there are many."""
        if len(self._followed) < self._shed_at:
            return
        held = {number: f for number, f in self._followed.items() if f.listeners or is_held(f)}
        self._followed, self._shed_at = held, MOST_UNHELD + 2 * len(held)

    def get(self, task_id: int) -> Followed | None:
        """Return a followed task, None if it is not followed."""
        return self._followed.get(task_id)

    def receive(self, status: TaskStatus, *, now: float) -> Followed | None:
        """Process a status. Return the followed task if this is news of it."""
        followed = self._followed.get(status.id)
        if followed is None or followed.is_over:
            return None
        if followed.nonce is None:
            followed.nonce = status.nonce
        before = followed.status
        if followed.nonce != status.nonce or (
            before is not None and before.command != status.command
        ):  # the id names another task now: the server restarted its task ids
            self.lose(followed)
            return followed
        if before is not None and status.version < before.version:
            return None  # a newer status arrived first
        followed.status = status
        followed.vehicle = status.vehicle  # a task of any rover may move to another one
        followed.patience = SILENT if status.is_active else min(followed.patience, SILENT_WAITING)
        followed.ask_at = now + followed.patience
        if status.is_over:
            self._followed.pop(status.id)
        return followed

    def lose(self, followed: Followed) -> None:
        """Mark a task as unknown to the server, and stop following it."""
        followed.is_lost = True
        if self._followed.get(followed.id) is followed:
            del self._followed[followed.id]

    def hurry(self, vehicle: int, *, now: float) -> None:
        """Make all tasks of a vehicle due: its server may be another process."""
        for followed in self._followed.values():
            if followed.vehicle == vehicle:
                followed.ask_at = now
                followed.patience = SILENT

    def next_deadline(self) -> float | None:
        """Return when to call ``to_ask``; None: no caller waits."""
        return min((f.ask_at for f in self._followed.values() if _is_awaited(f)), default=None)

    def to_ask(self, *, now: float) -> list[Followed]:
        """Return the tasks to ask about now; the interval of waiting tasks grows."""
        due = [f for f in self._followed.values() if _is_awaited(f) and now >= f.ask_at]
        for followed in due:
            if followed.status is not None and followed.status.is_waiting:
                followed.patience = min(2 * followed.patience, SILENT_WAITING)
            followed.ask_at = now + followed.patience
        return due

    def open_stream(self, vehicle: int, interval: float) -> float:
        """Add a stream of the active task's status. Return the interval to request, s."""
        intervals = self._streams.setdefault(vehicle, [])
        intervals.append(interval)
        return min(intervals)

    def close_stream(self, vehicle: int, interval: float) -> float | None:
        """Remove a stream. Return the interval to request, s; None: no stream."""
        intervals = self._streams[vehicle]
        intervals.remove(interval)
        return min(intervals, default=None)

    def stream_of(self, vehicle: int) -> float | None:
        """Return the requested interval, s; None: no stream."""
        return min(self._streams.get(vehicle, ()), default=None)


def _is_awaited(followed: Followed) -> bool:
    return followed.listeners > 0 and not followed.is_asked
