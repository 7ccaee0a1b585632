"""What waits until an event is durable: acknowledgements, each with its time limit."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple


class _Held(NamedTuple):
    number: int  # of the event that must be durable first
    give_up_at: float
    release: Callable[[], None]
    give_up: Callable[[], None]


class CommitGate:
    """Effects in the order of the events that they wait for."""

    def __init__(self) -> None:
        self._held: deque[_Held] = deque()

    def __len__(self) -> int:
        return len(self._held)

    def hold(
        self,
        number: int,
        *,
        give_up_at: float,
        release: Callable[[], None],
        give_up: Callable[[], None],
    ) -> None:
        """Call ``release`` once event ``number`` is durable, or ``give_up`` if too late."""
        self._held.append(_Held(number, give_up_at, release, give_up))

    def committed(self, through: int) -> None:
        """Release all that waited for events up to ``through``."""
        while self._held and self._held[0].number <= through:
            self._held.popleft().release()

    def next_deadline(self) -> float | None:
        """Give when the oldest has waited too long."""
        return self._held[0].give_up_at if self._held else None

    def handle_deadline(self, *, now: float) -> None:
        """Give up what has waited too long."""
        while self._held and self._held[0].give_up_at <= now:
            self._held.popleft().give_up()
