"""A disk that outlives servers, and the store of each server: slow, failing, killed with it.

A killed server's committed events are on the disk, and nothing else. The real store writes them
when the next server loads, so that virtual time needs no real disk.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import StoreFailed
from mav_tasks.store import Outcome
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored
from tests.kit.store import LateStore, PromptSqliteStore, write_halts


class Crash(BaseException):
    """The server dies in the middle of a turn, at a write."""


class Disk:
    """One store file. Times are the world's; ``wall_offset`` is UTC minus world time, s."""

    def __init__(self, path: Path, *, wall_offset: float) -> None:
        self._path, self.wall_offset = path, wall_offset
        self._open()

    def _open(self) -> None:
        forever = Retention(max_age=None)
        offset = lambda: self.wall_offset  # noqa: E731 - the clock may jump
        self._store = PromptSqliteStore(self._path, wall_offset=offset, keep=forever)

    def write(self, events: Sequence[Event], halts: Sequence[Event]) -> None:
        """Make events durable, in order; of the ``halts`` after them only the record knows."""
        if events:
            self._store.append(events)
            self._store.take_outcomes()
        self._store.close()
        write_halts(self._path, halts, wall_offset=self.wall_offset)
        self._open()

    def load(self, *, ended_well: bool, idle: float) -> Restored:
        """Return the state that the next server restores."""
        return replace(self._store.load(), ended_well=ended_well, idle=idle)

    def close(self) -> None:
        """Close the file."""
        self._store.close()


class UncertainStore(LateStore):
    """Implements ``Store`` for one server; can fail for a while, and kill its server."""

    def __init__(self) -> None:
        super().__init__()
        self.full_until = 0.0
        self.dies_in = 0  # appends; 0: not
        self.dies_before = True  # the write; else after it
        self._says_so = False

    def fill(self, seconds: float) -> None:
        """Refuse all writes for ``seconds``; only the record of halts has room."""
        self.full_until = self.clock() + seconds
        self._says_so = True

    def append(self, events: Sequence[Event]) -> None:
        """Queue events; raise Crash if the server dies here."""
        self.dies_in -= 1
        if self.dies_in == 0 and self.dies_before:
            raise Crash
        super().append(events)
        if self.dies_in == 0:
            raise Crash

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes of events; while the disk is full, one StoreFailed."""
        if self.clock() >= self.full_until:
            return super().take_outcomes()
        said: list[Outcome] = [StoreFailed("the disk is full")] if self._says_so else []
        delay, self.delay, self._says_so = self.delay, inf, False
        try:
            return said + super().take_outcomes()
        finally:
            self.delay = delay

    def committed(self, *, in_order: bool) -> tuple[list[Event], list[Event]]:
        """Return the events that survive an end now; one in order writes all that it can.

        Of the second ones only the record of halts knows.
        """
        if in_order and self.clock() >= self.full_until:
            self.delay = self.halts_delay = 0.0
        self.take_outcomes()
        return self.left_by_a_crash()
