"""The thread that makes events durable: it writes all waiting events in one transaction.

A batch that fails is retried, in the same order, until it is written. Its rows are made only once.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread

from mav_tasks.basics.clock import boot_time
from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.engine.inputs import Committed, NonceTaken, StoreFailed
from mav_tasks.store.base import Outcome
from mav_tasks.store.batch import Batch
from mav_tasks.store.codec import Encoder
from mav_tasks.store.event_database import EventDatabase
from mav_tasks.store.halt_record import HaltRecord
from mav_tasks.store.retention import Trimmer
from mav_tasks.tasks.events import Event

RETRY = 0.25  # s between two attempts
LAST_TRY = 1.0  # s, maximum duration of the current attempt, unless the disk is stuck
REPORT = 5.0  # s between two reports of a lasting failure
MOST_EVENTS = 1_024  # in one transaction, about; with more the first would wait for the last
TRIM_PERIOD = 60.0  # s between two searches for expired rows
TRIM_PAUSE = 0.05  # s between two steps of deleting


class Writer:
    """The database's owner from ``start`` until its end. Internal times: monotonic seconds."""

    def __init__(
        self,
        database: EventDatabase,
        mail: Mailbox[Outcome],
        trimmer: Trimmer,
        *,
        name: str,
        wall_offset: Callable[[], float],
        record: HaltRecord,
        release: Callable[[], None],
    ) -> None:
        self._database = database
        self._mail = mail
        self._trimmer = trimmer
        self._name = name
        self._wall_offset = wall_offset
        self._record = record
        self._release = release
        self._base = database.last_number  # reported event numbers are relative to this
        self._encoder = Encoder()
        self._waiting: SimpleQueue[Sequence[Event] | None] = SimpleQueue()
        self._give_up_at: float | None = None
        self._is_closing = False
        self._must_reopen = False
        self._refused: list[NonceTaken] = []  # of the last batch
        self._writing = 0  # events of the batch that is being written
        self._reported_at: float | None = None  # None: nothing is wrong
        self._trim_at = time.monotonic()
        self._thread = Thread(target=self._run, name="store", daemon=True)

    def __repr__(self) -> str:
        return f"Writer({self._database!r}, {'failing' if self._must_reopen else 'well'})"

    def start(self) -> None:
        self._thread.start()

    def trim_for(self, seconds: float) -> None:
        """Delete expired rows for at most so many seconds; call it before ``start``."""
        end = time.monotonic() + seconds
        while self._trim_at <= time.monotonic() < end:
            self._trim(pause=0.0)

    def append(self, events: Sequence[Event]) -> None:
        """Queue events; never blocks the loop's thread, which calls it."""
        self._waiting.put(events)

    def close(self, *, within: float) -> None:
        """Write the remaining events and end; wait at most ``within`` s and LAST_TRY.

        What is not written then, or may not be, is told.
        """
        self._give_up_at = time.monotonic() + within
        self._waiting.put(None)
        self._thread.join(within + LAST_TRY)
        if self._thread.is_alive() and self._writing:
            words = f"{self._writing} events or more may be lost: the last try takes too long"
            self._mail.put(StoreFailed(f"store {self._name}: {words}"))

    def utc(self) -> float:
        """Return the wall clock's time, s since 1970."""
        return boot_time() + self._wall_offset()

    def _run(self) -> None:
        try:
            is_all_written = True
            while is_all_written and not self._is_closing:
                events = self._collect()
                self._look()
                is_all_written = not events or self._write(events)
                self._trim()
            self._end(is_all_written)
        except Exception as mistake:  # noqa: BLE001 - a bug of ours: raised in the loop
            self._mail.put_mistake(mistake)
        finally:
            self._release()

    def _collect(self) -> list[Event]:
        """Return up to about MOST_EVENTS events; wait for them, or until something else is due."""
        events: list[Event] = []
        until_trim = max(0.001, self._trim_at - time.monotonic())
        try:
            item = self._waiting.get(timeout=min(until_trim, self._look_period()))
            while True:
                if item is None:
                    self._is_closing = True
                    break
                events += item
                if len(events) >= MOST_EVENTS:
                    break
                item = self._waiting.get_nowait()
        except Empty:
            pass
        return events

    def _look_period(self) -> float:
        return RETRY if self._must_reopen else self._database.look_period

    def _look(self) -> None:
        """Reopen a database that was lost while there was nothing to write, and report that."""
        if self._is_closing or not (self._must_reopen or not self._database.is_open()):
            return
        self._must_reopen = True
        try:
            self._database.reopen()
        except Exception as error:  # noqa: BLE001 - raised again if it is a bug
            self._note_failure(error)
            return
        self._must_reopen = False
        if self._reported_at is not None:
            self._reported_at = None
            self._mail.put(Committed(self._database.last_number - self._base))

    def _write(self, events: Sequence[Event]) -> bool:
        """Retry until the events are written; return False if closing ran out of time."""
        batch = Batch(
            events,
            first=self._database.last_number + 1,
            encoder=self._encoder,
            format_id=self._database.format_id,
            offset=self._wall_offset(),
        )
        self._writing = len(events)
        while not self._is_written(batch):
            if self._give_up_at is not None and time.monotonic() > self._give_up_at:
                words = (
                    f"{len(events)} events or more are lost: not written before the server ended"
                )
                self._mail.put(StoreFailed(f"store {self._name}: {words}"))
                return False
            time.sleep(RETRY)
        self._writing = 0
        self._reported_at = None
        for refused in self._refused:
            self._mail.put(refused)
        if batch.next_id:
            with suppress(OSError):  # only needed after an older file was restored
                self._record.note_next_id(batch.next_id, number=batch.last)
        self._mail.put(Committed(batch.last - self._base))
        return True

    def _is_written(self, batch: Batch) -> bool:
        try:
            if self._must_reopen:
                self._database.reopen()
            if self._database.last_number < batch.first:
                self._database.write(batch, utc=self.utc())
            elif not self._database.is_certain():  # the failed commit is in the WAL
                return False
            self._refused = self._database.refused(batch)
        except Exception as error:  # noqa: BLE001 - raised again if it is a bug
            self._note_failure(error)
            return False
        self._must_reopen = False
        return True

    def _note_failure(self, error: Exception) -> None:
        """Report a failure; raise the error if it is none."""
        words = self._database.failure(error)
        if words is None:
            raise error
        self._must_reopen = True
        now = time.monotonic()
        if self._reported_at is None or now >= self._reported_at + REPORT:
            self._reported_at = now
            self._mail.put(StoreFailed(f"store {self._name}: {words}"))

    def _trim(self, *, pause: float = TRIM_PAUSE) -> None:
        """Delete some expired rows if that is due; a disk failure waits for the next time."""
        if time.monotonic() < self._trim_at or self._is_closing:
            return
        try:
            has_more = self._database.trim(self._trimmer, utc=self.utc())
        except Exception as error:
            if self._database.failure(error) is None:
                raise
            self._must_reopen, has_more = True, False
        self._trim_at = time.monotonic() + (pause if has_more else TRIM_PERIOD)

    def _end(self, is_all_written: bool) -> None:
        try:
            self._database.close(utc=self.utc() if is_all_written else None)
        except Exception as error:
            words = self._database.failure(error)
            if words is None:
                raise
            self._mail.put(StoreFailed(f"store {self._name}: not closed cleanly: {words}"))
