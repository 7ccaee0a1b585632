"""The database of one server: opening, writing batches, reopening after a loss, closing.

A batch is one transaction in one round trip, durable when the answer comes. If the connection is
lost meanwhile, nobody knows whether it was committed: ``reopen`` begins a new epoch, after which
the old transaction is over in either way, and then reads the number of the last event.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from mav_tasks.basics.errors import StoreError
from mav_tasks.engine.inputs import NonceTaken
from mav_tasks.store.batch import Batch
from mav_tasks.store.batch_writing import find_format, write_batch
from mav_tasks.store.codec import dumps
from mav_tasks.store.holder import Replaced
from mav_tasks.store.postgres import schema
from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.dependencies import IS_EXPECTED, write_dependencies
from mav_tasks.store.postgres.failures import PostgresError, failure
from mav_tasks.store.postgres.ownership import Ownership
from mav_tasks.store.postgres.reader import PostgresReader
from mav_tasks.store.postgres.rights import check_rights
from mav_tasks.store.postgres.session import Limits, Session
from mav_tasks.store.postgres.writable import check_writable
from mav_tasks.store.retention import Trimmer

LOOK_PERIOD = 1.0  # s between two checks that the session still exists

LACKS_EVENTS = (
    "it lacks events that it had stored (it has {found}, this server stored {stored}):"
    " restore the right one, or end the server and check"
)


def inserts(base: str = "") -> dict[str, str]:
    """Return the statement that inserts many rows, by table; ``base`` + a row's number is stored.

    The rows come as one text: the server takes it apart faster than Python would make arrays.
    """
    return {
        "tasks": (
            "INSERT INTO tasks (id, number, vehicle, state, changed_at, submitted)"
            f" SELECT (r->>0)::bigint, {base}(r->>1)::bigint, (r->>2)::bigint,"
            " (r->>3)::integer, (r->>4)::double precision, r->>5"
            " FROM json_array_elements(?::json) AS r"
            # ids wrap around: without retention an old task may still have the id
            " ON CONFLICT (id) DO UPDATE SET number = excluded.number, vehicle = excluded.vehicle,"
            " state = excluded.state, changed_at = excluded.changed_at, epoch = excluded.epoch,"
            " submitted = excluded.submitted, changed = NULL, modified = NULL, advanced = NULL,"
            " run_after = NULL, assigned = NULL"
        ),
        "journal": (
            "INSERT INTO journal (number, utc, kind, task_id, vehicle, body)"
            f" SELECT {base}(r->>0)::bigint, (r->>1)::double precision, r->>2, (r->>3)::bigint,"
            " (r->>4)::bigint, r->>5 FROM json_array_elements(?::json) AS r"
        ),
    }


class PostgresDatabase:
    """Implements ``EventDatabase``, once ``begin`` has made this server the writer.

    It has the fleet's lock from the constructor until ``close``. The constructor and ``begin``
    raise StoreError.
    """

    look_period = LOOK_PERIOD
    _inserts = inserts()

    def __init__(
        self,
        address: Address,
        *,
        ownership: Ownership | None = None,
        purpose: str = "serve",
        limits: Limits | None = None,
    ) -> None:
        """``purpose`` tells the server's operator what its sessions are for."""
        self._address = address
        self._purpose, self._limits = purpose, limits
        self._ownership = ownership or Ownership()
        self._replaced: Replaced | None = None
        self.next_id = self.last_number = self.format_id = 0
        self.last_write: float | None = None
        self.ended_well = False
        with self._at_start():
            self._session = Session(address, purpose=purpose, limits=limits)
            try:
                check_writable(self._session)
                check_rights(self._session)
                self._ownership.lock(self._session)
                schema.migrate(self._session)
                #: names the fleet, over copies and moves of its database
                self.fleet: str = self._meta("fleet")[0]
            except BaseException:
                self._session.close()
                raise
        self.name = self._session.database

    def __repr__(self) -> str:
        return f"PostgresDatabase({self.name}, {self._ownership!r}, event {self.last_number})"

    def begin(self) -> None:
        """Become the writer, and read what the database has."""
        with self._at_start():
            self._ownership.begin(self._session)
            with self._session.transaction():
                self.format_id = find_format(self._session)
            row = self._meta("next_id, last_number, last_write, ended_well")
            self.next_id, self.last_number, self.last_write = row[:3]
            self.ended_well = bool(row[3])
            with self._fenced():  # durable before any rover is moved
                self._session.execute("UPDATE meta SET ended_well = 0")

    @property
    def is_replaced(self) -> bool:
        """Whether this server can store nothing any more."""
        return self._replaced is not None

    def is_open(self) -> bool:
        """Return whether the session still exists, as far as this end knows."""
        return self._session.is_open()

    def reopen(self) -> None:
        """Find out what the database has, in a new session if this one is lost.

        Raise Replaced, at each later call, too, if another server has taken the database over.
        """
        if self._replaced is not None:
            raise self._replaced
        if self._session.is_lost:
            self._session = Session(self._address, purpose=self._purpose, limits=self._limits)
            try:
                check_writable(self._session)
                self._ownership.lock(self._session)
                self._ownership.resume(self._session)
            except BaseException as error:
                self._session.close()
                if isinstance(error, Replaced):
                    self._replaced = error
                raise
        found, (fleet,) = self._stored(), self._meta("fleet")
        if found < self.last_number or fleet != self.fleet:
            self._session.close()
            raise PostgresError(LACKS_EVENTS.format(found=found, stored=self.last_number))
        self.last_number = found

    def write(self, batch: Batch, *, utc: float) -> None:
        """Make a batch durable, as a whole or not at all."""
        with self._fenced():
            write_batch(self._session, batch, insert=self._insert, utc=utc)
            write_dependencies(self._session, batch)
        self.last_number = batch.last

    def refused(self, batch: Batch) -> list[NonceTaken]:  # noqa: ARG002
        """Return []: one server knows all nonces itself."""
        return []

    def is_certain(self) -> bool:
        """Commit once more; return True: a batch that was there before is durable, too.

        A standby that must confirm each commit confirms them in their order.
        """
        with self._fenced():
            pass
        return True

    def trim(self, trimmer: Trimmer, *, utc: float) -> bool:
        """Delete some expired rows; return whether there may be more."""
        with self._cause(), self._session.transaction():
            self._ownership.fence(self._session)
            return trimmer.step(self._session, utc=utc, kept=IS_EXPECTED)

    def close(self, *, utc: float | None) -> None:
        """End the session; record a clean end at ``utc``, or none if None."""
        try:
            if utc is not None:
                with self._fenced():
                    self._session.execute("UPDATE meta SET ended_well = 1, last_write = ?", (utc,))
        finally:
            self._session.close()

    def reader(self) -> PostgresReader:
        """Return a new session for reading what was committed: not from a standby, which lags."""
        return PostgresReader(self._address, purpose=f"{self._purpose} load")

    def failure(self, error: Exception) -> str | None:
        """Return the words for a failure; None: it is a bug of ours."""
        return failure(error)

    def _stored(self) -> int:
        """Return the number of the last event that this server has stored."""
        return int(self._meta("last_number")[0])

    def _insert(self, table: str, _columns: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> None:
        self._session.execute(self._inserts[table], (dumps(rows),))

    @contextmanager
    def _fenced(self) -> Iterator[None]:
        """Execute the block in one round trip, durably, unless this server was replaced."""
        with self._cause(), self._session.batch():
            self._ownership.fence(self._session)
            yield

    @contextmanager
    def _cause(self) -> Iterator[None]:
        """Raise Replaced instead of the error of the fence."""
        try:
            yield
        except PostgresError as error:
            cause = self._ownership.failure_of(self._session, error)
            if isinstance(cause, Replaced):
                self._replaced = cause
                self._session.close()
            raise cause from error

    @contextmanager
    def _at_start(self) -> Iterator[None]:
        try:
            yield
        except (PostgresError, Replaced) as error:
            words = failure(error) or str(error)
            raise StoreError(f"store {self._address.shown}: {words}") from error

    def _meta(self, columns: str) -> tuple[Any, ...]:
        row = self._session.execute(f"SELECT {columns} FROM meta").fetchone()
        if row is None:
            raise PostgresError("its table meta is empty")
        return row
