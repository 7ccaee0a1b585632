"""What a client knows of the tasks that it follows, and when that is worth asking about. Pure.

The server tells each change unasked. Where nothing was heard of a task for a while, although
somebody waits for it, the word may have been lost, or the server was another process meanwhile.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mav_tasks.client.values import TaskStatus

SILENT = 2.0  # s without a word of a task that is under way
MOST_UNHELD = 100  # tasks followed, from which on it is looked whether anybody still holds them
SILENT_WAITING = 10.0  # s, at the most, without a word of one that waits


@dataclass(slots=True, eq=False, weakref_slot=True)
class Followed:
    """One task: its latest status, None before the first; how many wait for news."""

    id: int
    vehicle: int
    status: TaskStatus | None = None
    nonce: int | None = None
    listeners: int = 0
    ask_at: float = 0.0
    patience: float = SILENT
    is_asked: bool = False  # a question about it is under way
    is_lost: bool = False

    @property
    def is_over(self) -> bool:
        """Whether nothing more will be heard of it."""
        return self.is_lost or (self.status is not None and self.status.is_over)


class Watch:
    """The tasks followed, and the streams wished for them."""

    def __init__(self) -> None:
        self._followed: dict[int, Followed] = {}
        self._streams: dict[int, list[float]] = {}
        self._shed_at = MOST_UNHELD

    def __repr__(self) -> str:
        return f"Watch({list(self._followed)})"

    def follow(self, task_id: int, vehicle: int, *, nonce: int | None, now: float) -> Followed:
        """Follow a task; one that is followed already is given as it is."""
        followed = self._followed.get(task_id)
        if followed is None:
            followed = self._followed[task_id] = Followed(task_id, vehicle, nonce=nonce)
            followed.ask_at = now + followed.patience
        return followed

    def shed(self, is_held: Callable[[Followed], bool]) -> None:
        """Follow no more what nobody holds; looks only now and then, as they become many."""
        if len(self._followed) < self._shed_at:
            return
        held = {number: f for number, f in self._followed.items() if f.listeners or is_held(f)}
        self._followed, self._shed_at = held, MOST_UNHELD + 2 * len(held)

    def get(self, task_id: int) -> Followed | None:
        """Return one that is followed."""
        return self._followed.get(task_id)

    def receive(self, status: TaskStatus, *, now: float) -> Followed | None:
        """Take a status in; gives the task if this is news of it."""
        followed = self._followed.get(status.id)
        if followed is None or followed.is_over:
            return None
        if followed.nonce is None:
            followed.nonce = status.nonce
        before = followed.status
        if followed.nonce != status.nonce or (
            before is not None and before.command != status.command
        ):  # an id that means another task now: the server has begun anew
            self.lose(followed)
            return followed
        if before is not None and status.version < before.version:
            return None  # overtaken on its way
        followed.status = status
        followed.patience = SILENT if status.is_active else min(followed.patience, SILENT_WAITING)
        followed.ask_at = now + followed.patience
        if status.is_over:
            self._followed.pop(status.id)
        return followed

    def lose(self, followed: Followed) -> None:
        """The server knows it no more."""
        followed.is_lost = True
        if self._followed.get(followed.id) is followed:
            del self._followed[followed.id]

    def hurry(self, vehicle: int, *, now: float) -> None:
        """Have all tasks of a vehicle asked about: its server may be another process."""
        for followed in self._followed.values():
            if followed.vehicle == vehicle:
                followed.ask_at = now
                followed.patience = SILENT

    def next_deadline(self) -> float | None:
        """Return when somebody waits for news that are overdue."""
        return min((f.ask_at for f in self._followed.values() if _is_awaited(f)), default=None)

    def to_ask(self, *, now: float) -> list[Followed]:
        """Return the tasks to ask about now; each time later, while they wait."""
        due = [f for f in self._followed.values() if _is_awaited(f) and now >= f.ask_at]
        for followed in due:
            if followed.status is not None and followed.status.is_waiting:
                followed.patience = min(2 * followed.patience, SILENT_WAITING)
            followed.ask_at = now + followed.patience
        return due

    def open_stream(self, vehicle: int, interval: float) -> float:
        """Somebody wants the active task told so often (s); gives the interval to ask for."""
        intervals = self._streams.setdefault(vehicle, [])
        intervals.append(interval)
        return min(intervals)

    def close_stream(self, vehicle: int, interval: float) -> float | None:
        """Nobody wants that any more; gives the interval to ask for, None for no stream."""
        intervals = self._streams[vehicle]
        intervals.remove(interval)
        if not intervals:
            del self._streams[vehicle]
        return min(intervals, default=None)

    def stream_of(self, vehicle: int) -> float | None:
        """Return the interval that is wished for, seconds."""
        return min(self._streams.get(vehicle, ()), default=None)


def _is_awaited(followed: Followed) -> bool:
    return followed.listeners > 0 and not followed.is_asked
