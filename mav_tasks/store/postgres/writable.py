"""Whether a database can be written at all."""

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import Session

REPLICA = (
    "it is a replica, or the server is in recovery: use the primary server"
    " (several hosts: postgresql://USER@HOST1,HOST2/DATABASE)"
)
READ_ONLY = "it is read-only for this role: ALTER ROLE … RESET default_transaction_read_only"


def check_writable(session: Session) -> None:
    """Raise PostgresError if nothing can be written in a session."""
    ((is_replica, is_read_only),) = session.execute(
        "SELECT pg_is_in_recovery(), current_setting('transaction_read_only') = 'on'"
    ).fetchall()
    if is_replica or is_read_only:
        raise PostgresError(REPLICA if is_replica else READ_ONLY)
