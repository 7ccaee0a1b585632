"""Stores for tests in virtual time."""

from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from select import POLLIN, poll
from typing import ClassVar

from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import Committed, HaltsKept, StoreFailed
from mav_tasks.store import MemoryStore, Outcome
from mav_tasks.store.halt_record import HaltRecord, words_of
from mav_tasks.store.sqlite import SqliteStore
from mav_tasks.tasks.events import Event


class PromptSqliteStore(SqliteStore):
    """The real store on a real file; virtual time stands still while it writes."""

    #: closed after each test: many worlds would use up the process's files
    opened: ClassVar[list["PromptSqliteStore"]] = []

    def __init__(
        self,
        path: Path,
        *,
        wall_offset: float | Callable[[], float],
        keep: Retention | None = None,
    ) -> None:
        offset = wall_offset if callable(wall_offset) else lambda: wall_offset
        super().__init__(path, wall_offset=offset, retention=keep)
        self.events: list[Event] = []
        self._kept = 0
        self.opened.append(self)

    def append(self, events: Sequence[Event]) -> None:
        super().append(events)
        self.events += events

    def take_outcomes(self) -> list[Outcome]:
        outcomes = super().take_outcomes()
        while self._kept < len(self.events):
            for outcome in outcomes:
                assert isinstance(outcome, Committed | HaltsKept), outcome
                if isinstance(outcome, Committed):
                    self._kept = outcome.through
            if self._kept < len(self.events):
                mail = self.fileno()
                assert mail is not None, "closed"
                ready = poll()
                ready.register(mail, POLLIN)
                assert ready.poll(10_000), "the disk does not answer"
                outcomes += super().take_outcomes()
        return outcomes


class LateStore(MemoryStore):
    """Commits ``delay`` seconds after the append; ``inf``: never.

    ``halts_delay``: the same of its record of halts.
    """

    def __init__(self, *, delay: float = 0.0, halts_delay: float = 0.0) -> None:
        super().__init__()
        self.delay = delay
        self.halts_delay = halts_delay
        self.clock: Callable[[], float] = lambda: 0.0  # the world sets its own clock
        self._under_way: deque[tuple[float, int]] = deque()
        self._halts: deque[tuple[float, int]] = deque()
        self._failure: str | None = None
        self._kept = self._kept_halts = 0  # numbers

    def __repr__(self) -> str:
        return f"LateStore({len(self.events)} events, {len(self._under_way)} under way)"

    def fail(self, text: str) -> None:
        """Report a failure once."""
        self._failure = text

    def append(self, events: Sequence[Event]) -> None:
        super().append(events)
        self._under_way.append((self.clock(), self._count))
        if any(words_of(event, 0, offset=0.0) for event in events):
            self._halts.append((self.clock(), self._count))

    def take_outcomes(self) -> list[Outcome]:
        outcomes: list[Outcome] = []
        if self._failure is not None:
            outcomes.append(StoreFailed(self._failure))
            self._failure = None
        while self._halts and self._halts[0][0] + self.halts_delay <= self.clock():
            self._kept_halts = self._halts.popleft()[1]
            outcomes.append(HaltsKept(self._kept_halts))
        while self._under_way and self._under_way[0][0] + self.delay <= self.clock():
            self._kept = self._under_way.popleft()[1]
            outcomes.append(Committed(self._kept))
        return outcomes

    def left_by_a_crash(self) -> tuple[list[Event], list[Event]]:
        """Return what the database has, and the later events of which the halt record knows."""
        return self.events[: self._kept], self.events[self._kept : self._kept_halts]


LIFE = 1_000_000  # events; no server of a test records so many


def write_halts(path: Path, events: Sequence[Event], *, wall_offset: float) -> None:
    """Write to the halt record of a closed store what its database did not get."""
    record = HaltRecord(path, name=path.name)
    for number, event in enumerate(events, record.last_number + LIFE):
        record.write(*words_of(event, number, offset=wall_offset))
    record.close()
