"""A store in a database, whatever kind it is of: with its own writer thread, and a halt record."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.errors import StoreError
from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.config.settings import Retention
from mav_tasks.engine.inputs import Committed, HaltsKept
from mav_tasks.store import reading
from mav_tasks.store.base import Outcome, Which
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import Encoder
from mav_tasks.store.event_database import EventDatabase
from mav_tasks.store.halt_keeper import HaltKeeper
from mav_tasks.store.halt_record import ENDS, HaltRecord, Word, event_of, words_of
from mav_tasks.store.journal import Journal
from mav_tasks.store.retention import Trimmer
from mav_tasks.store.writer import Writer
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.restored import Restored

HALTS_LIMIT = 1.0  # s at shutdown for writing the last halts
CLOSE_LIMIT = 3.0  # s at shutdown for writing the remaining events
TRIM_AT_OPEN = 0.5  # s of deleting expired rows at start; the rest is done while serving


def _is_included(earlier: Outcome, later: Outcome) -> bool:
    return type(earlier) is type(later) and isinstance(earlier, Committed | HaltsKept)


class DurableStore:
    """Implements ``Store`` in an open database, which it closes.

    ``wall_offset`` returns the current UTC minus ``boot_time``. ``release`` is called when nothing
    uses database and record any more; also if the constructor raises, StoreError.
    """

    def __init__(
        self,
        database: EventDatabase,
        record: HaltRecord,
        *,
        name: str,
        wall_offset: Callable[[], float],
        retention: Retention | None,
        release: Callable[[], None],
    ) -> None:
        self._wall_offset = wall_offset
        self.name = self.place = name
        self._database = database
        self._stopped: dict[int, TaskReason] = {}  # by vehicle
        try:
            was_complete = self._catch_up(record)
        except BaseException:
            release()
            raise
        utc = boot_time() + wall_offset()
        self._ended_well = database.ended_well and was_complete
        self._idle = 0.0 if database.last_write is None else max(0.0, utc - database.last_write)
        self._mail: Mailbox[Outcome] = Mailbox(replaces=_is_included)
        trimmer = Trimmer(retention or Retention())
        self._writer = Writer(
            database,
            self._mail,
            trimmer,
            name=self.name,
            wall_offset=wall_offset,
            record=record,
            release=release,
        )
        self._number = database.last_number
        self._keeper = HaltKeeper(
            record, self._mail, name=self.name, kept_through=lambda: database.last_number
        )
        self._is_open = True
        self._writer.trim_for(TRIM_AT_OPEN)
        self._writer.start()
        self._keeper.start()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    def load(self) -> Restored:
        """Return the stored state, times in this process's monotonic seconds; raise StoreError."""
        with closing(self._database.reader()) as reader:
            restored = reading.read_restored(
                reader, offset=self._wall_offset(), ended_well=self._ended_well, idle=self._idle
            )
        return replace(restored, stopped=self._stopped)

    def journal(self) -> Iterator[tuple[int, Event]]:
        """Yield every stored event, numbered over the life of the store; raise StoreError."""
        with closing(Journal(self._database.reader(), Which())) as journal:
            yield from journal.take(offset=self._wall_offset())

    def append(self, events: Sequence[Event]) -> None:
        """Queue events to be made durable, without blocking; raise ValueError after ``close``."""
        if not self._is_open:
            raise ValueError("the store is closed")
        first, offset = self._number + 1, self._wall_offset()
        self._number += len(events)
        halts = [
            word
            for number, event in enumerate(events, first)
            for word in words_of(event, number, offset=offset)
        ]
        if halts:
            self._keeper.append(halts, through=self._number)
        self._writer.append(tuple(events))

    def take_outcomes(self) -> list[Outcome]:
        """Return the outcomes since the last call; raise an exception of the store's threads."""
        return self._mail.take()

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while there are outcomes; None once closed."""
        return self._mail.fileno()

    def close(self) -> None:
        """Write the remaining events, record the clean end and release the lock.

        Give up after CLOSE_LIMIT if the disk fails or is stuck; the store stays locked while the
        disk is stuck.
        """
        if self._is_open:
            self._is_open = False
            self._keeper.close(within=HALTS_LIMIT)
            self._writer.close(within=self._close_limit())
            self._keeper.report_lost()
            self._mail.close()

    def _close_limit(self) -> float:
        """Return how long ``close`` may wait for the remaining events, s."""
        return CLOSE_LIMIT

    def _missing(self, words: list[Word]) -> list[Word]:
        """Return those of the words that the database lacks by their numbers which count still."""
        return words

    def _catch_up(self, record: HaltRecord) -> bool:
        """Write newer words of the halt record to the database; return False if it lacked any."""
        database = self._database
        missing = self._missing(record.words_after(database.last_number))
        ends = [word for word in missing if word.register in ENDS.values()]
        newer = [word for word in missing if word not in ends]
        next_id = record.next_id_after(database.last_number)
        for word in sorted(ends, key=lambda word: word.reason is TaskReason.STOPPED):
            self._stopped[word.vehicle] = word.reason  # STOP ends more than an emergency stop
        if not newer and next_id is None:
            return not ends
        offset = self._wall_offset()
        batch = Batch(
            [event_of(word, offset=offset) for word in newer],
            first=record.last_number + 1,  # numbers that an earlier process may have used are lost
            encoder=Encoder(),
            format_id=database.format_id,
            offset=offset,
        )
        batch.next_id = next_id
        try:
            if ends:  # the server that opens the store ends these tasks with its first events
                record.outlast(ends, batch.last + 1)
            database.write(batch, utc=database.last_write or 0.0)
        except Exception as error:
            words = database.failure(error)
            database.close(utc=None)
            if words is None:
                raise
            raise StoreError(f"store {self.name}: {words}") from error
        return False
