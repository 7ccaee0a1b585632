"""A disk that outlives servers, and the store of each server: slow, failing, killed with it.

A killed server's committed events are on the disk, and nothing else. The code for the real file
writes them when the next server loads, so that virtual time needs no real disk.
"""

from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path

from mav_tasks.settings import Retention
from mav_tasks.store import Kept, NotKept, Outcome
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import Encoder
from mav_tasks.store.database import Database
from mav_tasks.store.held_file import HeldFile
from mav_tasks.store.reading import read_restored
from mav_tasks.store.retention import Trimmer
from mav_tasks.tasks.events import Event, QueueContinued, QueuePaused, VehicleHalted
from mav_tasks.tasks.restored import Restored
from tests.kit.store import LateStore

HALTS = (QueuePaused, QueueContinued, VehicleHalted)


class Disk:
    """One store file. Times are the world's; ``wall_offset`` is UTC minus world time, s."""

    def __init__(self, path: Path, *, wall_offset: float) -> None:
        self.path = path
        self.wall_offset = wall_offset
        self._file = HeldFile(path)
        self._database = Database(path, self._file)
        self._database.begin(self._database.fleet or "00" * 16)
        self._encoder = Encoder()

    def write(self, events: Sequence[Event], *, now: float) -> None:
        """Make events durable, in order."""
        if events:
            batch = Batch(
                events,
                first=self._database.last_number + 1,
                encoder=self._encoder,
                format_id=self._database.format_id,
                offset=self.wall_offset,
            )
            self._database.write(batch, utc=now + self.wall_offset)

    def forget(self, retention: Retention, *, now: float) -> None:
        """Trim everything that the retention permits."""
        trimmer = Trimmer(retention)
        while self._database.trim(trimmer, utc=now + self.wall_offset):
            pass

    def load(self, *, ended_well: bool, idle: float) -> Restored:
        """Return the state that the next server restores."""
        with closing(self._database.reader()) as reader:
            return read_restored(reader, offset=self.wall_offset, ended_well=ended_well, idle=idle)

    def close(self) -> None:
        """Close the file."""
        self._database.close(utc=None)
        self._file.close()


class UncertainStore(LateStore):
    """Implements ``Store`` for one server; can fail for a while."""

    def __init__(self) -> None:
        super().__init__()
        self.broken_until = 0.0
        self.kept = 0  # events that the server knows to be durable
        self._says_so = False

    def break_for(self, seconds: float) -> None:
        """Refuse all writes for ``seconds``."""
        self.broken_until = self.clock() + seconds
        self._says_so = True

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes of events; during a failure, one NotKept."""
        if self.clock() < self.broken_until:
            said, self._says_so = self._says_so, False
            return [NotKept("the disk is full")] if said else []
        outcomes = super().take_outcomes()
        self.kept = max((o.through for o in outcomes if isinstance(o, Kept)), default=self.kept)
        return outcomes

    def committed(self) -> list[Event]:
        """Return the events that would survive a stop now, possibly more than reported.

        Halts have their own record, which accepts them even on a full disk.
        """
        due: Iterable[int] = ()
        if self.clock() >= self.broken_until:
            due = (end for at, end in self._under_way if at + self.delay <= self.clock())
        end = max(due, default=self.kept)
        return [
            *self.events[:end],
            *(each for each in self.events[end:] if isinstance(each, HALTS)),
        ]
