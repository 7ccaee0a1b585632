"""An advisory lock that a process has for as long as its session lives, over its sessions."""

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import Session

LOCK_NOT_AVAILABLE = "55P03"


class SessionLock:
    """The lock of a number of 64 bits: the purpose above, 32 bits of what it is about below."""

    def __init__(self, number: int, *, is_shared: bool = False) -> None:
        """``is_shared``: others may have it, too, unless one has it for itself."""
        self._lock = "pg_advisory_lock_shared" if is_shared else "pg_advisory_lock"
        self._halves = number >> 32, number & 0xFFFFFFFF
        self._number = number
        self._backend: tuple[int, str] | None = None  # of the session that had the lock last

    def __repr__(self) -> str:
        return f"SessionLock({self._number:#x})"

    def take(self, session: Session) -> None:
        """Take the lock; raise PostgresError (LOCK_NOT_AVAILABLE) if another process has it.

        An earlier session of this process may have it: the database does not notice the loss of a
        connection at once. That session is ended.
        """
        if self._backend is not None:
            session.execute(_END_OWN_SESSION, (*self._halves, *self._backend))
        session.execute(f"SELECT {self._lock}(?)", (self._number,))
        found = session.execute(_OWN_BACKEND).fetchone()
        if found is None:
            raise PostgresError("the database does not show this session in pg_stat_activity")
        self._backend = found[0], found[1]


_OWN_BACKEND = (
    "SELECT pid, extract(epoch FROM backend_start)::text FROM pg_stat_activity"
    " WHERE pid = pg_backend_pid()"
)
_END_OWN_SESSION = (
    "SELECT pg_terminate_backend(pid) FROM pg_locks JOIN pg_stat_activity USING (pid)"
    " WHERE locktype = 'advisory' AND granted AND classid = ? AND objid = ? AND objsubid = 1"
    " AND database = (SELECT oid FROM pg_database WHERE datname = current_database())"
    " AND pid = ? AND extract(epoch FROM backend_start)::text = ?"
)
