"""The thread that writes halts to the halt record, independently of the database.

``HaltsKept`` tells what the record has: then a halt may be acknowledged. If the record fails, the
database may still store the halt. A halt that neither has stored within GRACE seconds is reported,
again every REPORT seconds, and retried until it is stored.
"""

import time
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from threading import Thread

from mav_tasks.basics.mailbox import Mailbox
from mav_tasks.engine.inputs import HaltNotStored, HaltsKept
from mav_tasks.store.base import Outcome
from mav_tasks.store.failures import words_for
from mav_tasks.store.halt_record import HaltRecord, Word
from mav_tasks.tasks.events import QueuePaused

RETRY = 0.25  # s between two attempts
GRACE = 1.0  # s, in which the database may store a halt that the record could not
REPORT = 10.0  # s between two reports of a halt that is not stored


class HaltKeeper:
    """The only writer of the vehicles' cells in a record. Times are monotonic seconds."""

    def __init__(
        self,
        record: HaltRecord,
        mail: Mailbox[Outcome],
        *,
        name: str,
        kept_through: Callable[[], int],
    ) -> None:
        """``kept_through`` returns the number of the last event in the database."""
        self._record = record
        self._mail = mail
        self._name = name
        self._kept_through = kept_through
        self._base = self._through = kept_through()  # reported numbers are relative to the first
        self._waiting: SimpleQueue[tuple[Sequence[Word], int] | None] = SimpleQueue()
        self._unkept: dict[int, Word] = {}  # by register
        self._report_at: dict[int, float] = {}  # by register
        self._is_closing = False
        self._thread = Thread(target=self._run, name="halts", daemon=True)

    def __repr__(self) -> str:
        return f"HaltKeeper({self._record!r}, {len(self._unkept)} not kept)"

    def start(self) -> None:
        self._thread.start()

    def append(self, words: Sequence[Word], *, through: int) -> None:
        """Queue the words of events up to ``through``, from the loop; never block it."""
        self._waiting.put((words, through))

    def close(self, *, within: float) -> None:
        """Try the remaining words once more and end the thread; wait at most ``within`` s."""
        self._waiting.put(None)
        self._thread.join(within)

    def report_lost(self) -> None:
        """Report each halt that was not stored; called after this thread and the writer ended."""
        for word in self._unkept.values():
            if word.is_halt and word.number > self._kept_through():
                self._mail.put(
                    HaltNotStored(word.vehicle, f"store {self._name}: lost: {_told(word)}")
                )

    def _run(self) -> None:
        try:
            while not self._is_closing:
                self._collect()
                if self._unkept:
                    self._keep(tuple(self._unkept.values()))
        except Exception as mistake:  # noqa: BLE001 - a bug of ours: raised in the loop
            self._mail.put_mistake(mistake)

    def _collect(self) -> None:
        """Wait for words, or until the next attempt is due."""
        try:
            item = self._waiting.get(timeout=RETRY if self._unkept else None)
            while item is not None:
                words, self._through = item
                self._unkept.update((word.key, word) for word in words)
                item = self._waiting.get_nowait()
            self._is_closing = True
        except Empty:
            pass

    def _keep(self, words: Sequence[Word]) -> None:
        """Write words in one go; those that the database has kept meanwhile need no record."""
        left: list[Word] = []
        try:
            self._record.write(*words)
        except OSError as error:
            through = self._kept_through()
            left = [word for word in words if word.number > through]
            for word in left:
                self._report(word, words_for(error))
        else:
            self._mail.put(HaltsKept(self._through - self._base))
        self._unkept = {word.key: word for word in left}
        self._report_at = {key: at for key, at in self._report_at.items() if key in self._unkept}

    def _report(self, word: Word, why: str) -> None:
        now = time.monotonic()
        if word.is_halt and now >= self._report_at.setdefault(word.key, now + GRACE):
            self._report_at[word.key] = now + REPORT
            text = f"store {self._name}: halt not stored ({why}): {_told(word)}"
            self._mail.put(HaltNotStored(word.vehicle, text))


def _told(word: Word) -> str:
    return str(QueuePaused(word.vehicle, word.reason, word.actor, at=0.0))
