"""A session of a database server: sends SQL, and never waits longer than its limits.

It uses libpq's pipeline mode through ``psycopg.pq``: all statements of a batch are sent together
and answered in one round trip. psycopg's own cursors would do that in four times the time, under
the interpreter's lock, beside the loop that drives the rovers; and they wait without a limit.
Values are sent as text, and the server finds their types.
"""

import logging
import select
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from itertools import count
from typing import Any

import psycopg
from psycopg import pq
from psycopg.adapt import Transformer

from mav_tasks.store.postgres.address import Address
from mav_tasks.store.postgres.failures import LOST, PostgresError, connecting

OLDEST = 140_000  # PostgreSQL 14; older ones get no corrections any more
WITH_TRANSACTION_TIMEOUT = 170_000  # PostgreSQL 17
SCHEMA = "mav_tasks"

_CONNECT_LIMIT = 2  # s for each host, libpq's least
#: of TCP, so that both sides notice a dead machine or a cut cable within some seconds
_KEEPALIVES = {"keepalives_idle": "3", "keepalives_interval": "1", "keepalives_count": "3"}
_ROWS = pq.ExecStatus.TUPLES_OK
_OK = (pq.ExecStatus.COMMAND_OK, _ROWS, pq.ExecStatus.EMPTY_QUERY)


@dataclass(frozen=True, slots=True)
class Limits:
    """How long a session waits for what, in seconds; the defaults are those of a server."""

    answer: float = 3.0  # without a byte from the server: then the connection counts as lost
    statement: float = 2.0  # after which the server gives a statement up
    lock: float = 1.0  # after which the server gives up waiting for a lock of another program
    in_transaction: float = 5.0  # after which it ends the transaction of a suspended process
    sending: float = 3.0  # in which the other machine must acknowledge what was sent
    #: after which the server ends a session whose transaction is not over, also if a batch was sent
    #: only in part; PostgreSQL 17 and newer. 0: never
    transaction: float = 0.0


READING = Limits(answer=30.0, statement=30.0)  # a query may sort many rows


class Found:
    """The rows that a statement has found; implements ``Cursor``."""

    def __init__(self, rows: list[tuple[Any, ...]]) -> None:
        self._rows = rows
        self._next = 0

    def __repr__(self) -> str:
        return f"Found({len(self._rows)} rows)"

    def fetchone(self) -> tuple[Any, ...] | None:
        """Return the next row; None if there are no more."""
        return next(iter(self.fetchmany(1)), None)

    def fetchmany(self, size: int) -> list[tuple[Any, ...]]:
        begin, self._next = self._next, self._next + size
        return self._rows[begin : self._next]

    def fetchall(self) -> list[tuple[Any, ...]]:
        begin, self._next = self._next, len(self._rows)
        return self._rows[begin:]

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        return iter(self.fetchall())


class Session:
    """Implements ``Connection``. Methods raise PostgresError; after LOST only ``close`` is left.

    Outside ``batch`` and ``transaction`` each statement is a transaction of its own.
    """

    def __init__(self, address: Address, *, purpose: str, limits: Limits | None = None) -> None:
        """Connect. ``purpose`` tells the server's operator what the session is for."""
        limits = limits or Limits()
        logging.getLogger("psycopg").disabled = True  # errors are raised, and told by the store
        parameters: dict[str, Any] = {
            "application_name": f"mav-tasks {purpose}",
            **_KEEPALIVES,
            "tcp_user_timeout": _milliseconds(limits.sending),
            "connect_timeout": _CONNECT_LIMIT,
            **address.parameters,
            "client_encoding": "UTF8",
        }
        if "," in parameters.get("host", "") and purpose != "read":
            parameters.setdefault("target_session_attrs", "read-write")
        try:
            self._connection = psycopg.connect(**parameters, autocommit=True)
        except UnicodeError:
            raise PostgresError("the host's name is not valid", sqlstate=LOST) from None
        except psycopg.Error as error:
            raise PostgresError(connecting(str(error)), sqlstate=LOST) from None
        self._pg = self._connection.pgconn
        self._limit = limits.answer
        self._poll = select.poll()
        self._poll.register(self._pg.socket)
        self._names: dict[str, bytes] = {}  # of prepared statements, by their SQL
        #: what was sent since the last sync: SQL to be prepared, or None: a statement's execution
        self._sent: list[str | None] = []
        self._numbers = count(1)
        self._is_batch = False
        self._warnings: list[str] = []
        self._pg.notice_handler = self._note
        try:
            self._pg.enter_pipeline_mode()
            self._check_version()
            self._set_up(_settings(limits, version=self._pg.server_version))
        except BaseException:
            self.close()
            raise

    def __repr__(self) -> str:
        return f"Session({'lost' if self.is_lost else self._pg.backend_pid})"

    @property
    def is_lost(self) -> bool:
        """Whether the connection has ended."""
        return self._connection.closed

    @property
    def database(self) -> str:
        """The name of the database."""
        return self._pg.db.decode()

    def execute(self, statement: str, values: Sequence[Any] = ()) -> Found:
        """Execute a statement and return its rows; within ``batch`` queue it, and return none."""
        self._send(statement, values)
        return Found([] if self._is_batch else self._rows(self._sync()[-1]))

    def executemany(self, statement: str, rows: Iterable[Sequence[Any]]) -> None:
        """Execute a statement for each row, all of them in one round trip."""
        for row in rows:
            self._send(statement, row)
        if not self._is_batch:
            self._sync()

    @contextmanager
    def batch(self) -> Iterator[list[Found]]:
        """Execute the block's statements in one transaction and one round trip.

        In libpq's pipeline mode all statements up to a sync are one transaction, which the sync
        commits. After the block the list has what each query in it has found. Raise PostgresError
        if the block is not durable, on every server that must have it: a warning says that a
        standby has not confirmed it.
        """
        self._warnings.clear()
        self._is_batch = True
        found: list[Found] = []
        try:
            yield found
        except BaseException:
            self.close()  # what was queued must not be committed by a later sync
            raise
        finally:
            self._is_batch = False
        results = self._sync()
        found += [Found(self._rows(each)) for each in results if each.status == _ROWS]
        if self._warnings:
            raise PostgresError(f"not confirmed by the database: {self._warnings[0]}")

    @contextmanager
    def transaction(self, mode: str = "") -> Iterator[None]:
        """Commit the block's statements, or roll them back if the block raises."""
        self._warnings.clear()
        self.execute(f"BEGIN {mode}")
        try:
            yield
            self.execute("COMMIT")
        except BaseException:
            if not self.is_lost:
                try:
                    self.execute("ROLLBACK")
                except PostgresError:
                    self.close()
            raise
        if self._warnings:
            raise PostgresError(f"not confirmed by the database: {self._warnings[0]}")

    def fileno(self) -> int:
        """Return the descriptor that is readable when the server has said something."""
        return self._pg.socket

    def notifications(self) -> list[tuple[str, str]]:
        """Return the notifications that have come since the last call, each a channel and a text.

        It does not wait. Other sessions send them (NOTIFY), also while a statement is executed.
        """
        try:
            self._pg.consume_input()
            return list(self._notified())
        except psycopg.Error as error:
            raise self._loss(str(error)) from None

    def is_open(self) -> bool:
        """Return whether the session still exists; ask the server only if it has said something.

        While nothing is asked, a server says nothing, unless it ends the session.
        """
        if self.is_lost:
            return False
        self._poll.modify(self._pg.socket, select.POLLIN)
        if self._poll.poll(0):
            try:
                self.execute("SELECT 1")
            except PostgresError:
                self.close()
        return not self.is_lost

    def close(self) -> None:
        """End the session; may be called again."""
        self._connection.close()

    def _notified(self) -> Iterator[tuple[str, str]]:
        while (it := self._pg.notifies()) is not None:
            yield it.relname.decode(), it.extra.decode(errors="replace")

    def _check_version(self) -> None:
        version = self._pg.server_version
        if version < OLDEST:
            told = f"{version // 10_000}.{version % 10_000}"
            oldest = OLDEST // 10_000
            raise PostgresError(
                f"PostgreSQL {told} is too old: use version {oldest} or a newer one"
            )

    def _set_up(self, settings: dict[str, str]) -> None:
        """Set the session's parameters in one round trip."""
        for name, value in settings.items():
            self._send("SELECT set_config(?, ?, false)", (name, value))
        self._send(  # an operator's remote_apply is stronger
            "SELECT set_config('synchronous_commit', 'on', false)"
            " WHERE current_setting('synchronous_commit') <> 'remote_apply'",
            (),
        )
        self._sync()

    def _send(self, statement: str, values: Sequence[Any]) -> None:
        texts = [_text(value) for value in values]
        try:
            name = self._names.get(statement)
            if name is None:
                name = self._names[statement] = b"s%d" % next(self._numbers)
                self._sent.append(statement)
                self._pg.send_prepare(name, _numbered(statement))
            self._sent.append(None)
            self._pg.send_query_prepared(name, texts)
        except psycopg.Error as error:
            raise self._loss(str(error)) from None

    def _sync(self) -> list[pq.abc.PGresult]:
        """Send what is queued, and return the results; raise the first error."""
        results: list[pq.abc.PGresult] = []
        failed: PostgresError | None = None
        try:
            self._pg.pipeline_sync()
            while self._pg.flush():
                self._wait(select.POLLIN | select.POLLOUT)
                self._pg.consume_input()
            while True:
                while self._pg.is_busy():
                    self._wait(select.POLLIN)
                    self._pg.consume_input()
                result = self._pg.get_result()
                if result is None:
                    if self._pg.status != pq.ConnStatus.OK:
                        raise failed or self._loss("the connection is lost")
                elif result.status == pq.ExecStatus.PIPELINE_SYNC:
                    break
                elif result.status in _OK:
                    results.append(result)
                elif result.status == pq.ExecStatus.FATAL_ERROR and failed is None:
                    failed = _error_of(result)
        except psycopg.Error as error:
            raise failed or self._loss(str(error)) from None
        sent, self._sent = self._sent, []
        if failed is not None:
            for statement in sent[len(results) :]:  # the first that failed, and what was skipped
                if statement is not None:
                    del self._names[statement]
            raise failed
        return results

    def _rows(self, result: pq.abc.PGresult) -> list[tuple[Any, ...]]:
        found = Transformer(self._connection)
        found.set_pgresult(result)
        return found.load_rows(0, result.ntuples, tuple)

    def _wait(self, events: int) -> None:
        self._poll.modify(self._pg.socket, events)
        if not self._poll.poll(self._limit * 1000):
            raise self._loss(f"no answer from the database within {self._limit:g} s")

    def _loss(self, words: str) -> PostgresError:
        """Close the connection; return the error to raise."""
        self.close()
        return PostgresError(words, sqlstate=LOST)

    def _note(self, notice: pq.abc.PGresult) -> None:
        if _field(notice, pq.DiagnosticField.SEVERITY_NONLOCALIZED) == "WARNING":
            self._warnings.append(_field(notice, pq.DiagnosticField.MESSAGE_PRIMARY))


def _settings(limits: Limits, *, version: int) -> dict[str, str]:
    """Return the parameters of a session with a server of this version."""
    timeout = {"transaction_timeout": _milliseconds(limits.transaction)}
    return {
        "search_path": SCHEMA,
        "statement_timeout": _milliseconds(limits.statement),
        "lock_timeout": _milliseconds(limits.lock),
        "idle_in_transaction_session_timeout": _milliseconds(limits.in_transaction),
        "idle_session_timeout": "0",
        "client_min_messages": "warning",
        **{f"tcp_{name}": value for name, value in _KEEPALIVES.items()},
        "tcp_user_timeout": _milliseconds(limits.sending),
        **(timeout if version >= WITH_TRANSACTION_TIMEOUT else {}),
    }


def _milliseconds(seconds: float) -> str:
    return f"{seconds * 1000:.0f}"


@cache
def _numbered(statement: str) -> bytes:
    """Return a statement with $1, $2 … for each question mark."""
    first, *rest = statement.split("?")
    return (first + "".join(f"${n}{part}" for n, part in enumerate(rest, 1))).encode()


def _text(value: Any) -> bytes | None:
    if value is None:
        return None
    if isinstance(value, str):
        if "\0" in value:  # libpq would cut the text there
            raise ValueError("a text for PostgreSQL contains a zero byte")
        return value.encode()
    if isinstance(value, float):
        return repr(value).encode()
    return b"%d" % value


def _error_of(result: pq.abc.PGresult) -> PostgresError:
    return PostgresError(
        _field(result, pq.DiagnosticField.MESSAGE_PRIMARY) or result.error_message.decode(),
        sqlstate=_field(result, pq.DiagnosticField.SQLSTATE),
        table=_field(result, pq.DiagnosticField.TABLE_NAME),
        column=_field(result, pq.DiagnosticField.COLUMN_NAME),
    )


def _field(result: pq.abc.PGresult, field: pq.DiagnosticField) -> str:
    return (result.error_field(field) or b"").decode(errors="replace")
