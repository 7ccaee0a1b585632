"""Which server may write a database: a lock for as long as its session lives, and a fence.

One database holds one fleet. The server that opens it takes an advisory lock of its session, which
the database releases as soon as the process has died: a second server is refused while the first
one lives. The lock does not protect from a server that lost its session and does not know that yet.
So each opening, and each new session of a server, increments the *epoch* in the row of ``writer``
(a fencing token), and each transaction begins with ``fence``, which fails if the epoch is not the
writer's own any more. The row's lock puts both in an order: once an epoch was incremented, a
transaction of an older one has either been committed before or never will be.
"""

import os
import socket
import time

from mav_tasks.store.holder import Holder, Replaced, words_for
from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import Session
from mav_tasks.store.postgres.session_lock import LOCK_NOT_AVAILABLE, SessionLock

LOCK = 0x4D565453_00000001  # "MVTS", and the first purpose; gateways of a fleet share it

_NOT_NULL_VIOLATION, _UNDEFINED_TABLE = "23502", "42P01"


class Ownership:
    """The lock and the epoch of one server, over its sessions. Methods raise PostgresError."""

    table = "writer"  # of the column that refuses a fence

    def __init__(self, *, is_shared: bool = False) -> None:
        self.epoch = 0
        self._lock = SessionLock(LOCK, is_shared=is_shared)

    def __repr__(self) -> str:
        return f"Ownership(epoch {self.epoch})"

    def lock(self, session: Session) -> None:
        """Take the lock; raise an error that names the server which has it.

        It is Replaced if that server has begun to write since this one did.
        """
        try:
            self._lock.take(session)
        except PostgresError as error:
            if error.sqlstate != LOCK_NOT_AVAILABLE:
                raise
            raise self._in_use(session) from error

    def _in_use(self, session: Session) -> Exception:
        """Return the error if another process has the lock."""
        holder = holder_if_any(session)
        if self.epoch and holder is not None and holder.epoch > self.epoch:
            return _replaced_by(holder)
        if self.epoch and holder is not None and holder.epoch == self.epoch:
            return PostgresError("the database has not ended the lost session yet")
        return PostgresError(f"in use by {_gateways(session) or words_for(holder)}")

    def begin(self, session: Session) -> None:
        """Make this server the writer, by a new epoch."""
        (epoch,) = _only(
            session,
            "UPDATE writer SET epoch = epoch + 1, host = ?, pid = ?, since = ? RETURNING epoch",
            socket.gethostname(),
            os.getpid(),
            time.time(),
        )
        self._enter(session, epoch)

    def resume(self, session: Session) -> None:
        """Go on in a new session, by a new epoch; raise Replaced if another server has begun."""
        query = "UPDATE writer SET epoch = epoch + 1 WHERE epoch = ? RETURNING epoch"
        found = session.execute(query, (self.epoch,)).fetchone()
        if found is None:
            raise self._replaced(session)
        self._enter(session, found[0])

    def fence(self, session: Session) -> None:
        """Make the transaction fail if another server has begun since.

        Then the expression is NULL, which the column refuses.
        """
        session.execute(
            "UPDATE writer SET epoch = CASE WHEN epoch = ? THEN epoch END", (self.epoch,)
        )

    def failure_of(self, session: Session, error: PostgresError) -> Exception:
        """Return Replaced if an error is the fence's, else the error itself."""
        if error.sqlstate == _NOT_NULL_VIOLATION and error.table == self.table:
            return self._replaced(session)
        return error

    def _enter(self, session: Session, epoch: int) -> None:
        self.epoch = epoch
        # the column "epoch" of each row that this session inserts
        session.execute("SELECT set_config('mav_tasks.epoch', ?, false)", (str(epoch),))

    def _replaced(self, session: Session) -> Exception:
        holder = _holder(session)
        if holder is None or holder.epoch < self.epoch:
            return PostgresError(
                "it is not the database that was opened, or an older copy of it: restore that one,"
                " or end the server and check"
            )
        return _replaced_by(holder)


def _holder(session: Session) -> Holder | None:
    found = session.execute("SELECT epoch, host, pid, since FROM writer").fetchone()
    return None if found is None else Holder(*found)


def holder_if_any(session: Session) -> Holder | None:
    """Return the holder; None if the first server has not made the tables yet."""
    try:
        return _holder(session)
    except PostgresError as error:
        if error.sqlstate != _UNDEFINED_TABLE:
            raise
        return None


def _gateways(session: Session) -> str:
    """Return the words for the gateways that share the lock; "" if one has it for itself."""
    found = session.execute(
        "SELECT application_name FROM pg_locks JOIN pg_stat_activity USING (pid)"
        " WHERE locktype = 'advisory' AND granted AND mode = 'ShareLock' AND objsubid = 1"
        " AND classid = ? AND objid = ?"
        " AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
        " ORDER BY application_name",
        (LOCK >> 32, LOCK & 0xFFFFFFFF),
    ).fetchall()
    names = [name.removeprefix("mav-tasks ").removesuffix(" store") for (name,) in found]
    return f"a fleet: {', '.join(names)}" if names else ""


def _replaced_by(holder: Holder) -> Replaced:
    return Replaced(
        f"{holder} has taken the database over: this server can store nothing any more; end it"
    )


def _only(session: Session, statement: str, *values: object) -> tuple[int, ...]:
    found = session.execute(statement, values).fetchone()
    if found is None:
        raise PostgresError("a table has lost its row")
    return found
