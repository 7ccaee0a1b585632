"""Whether a database can be written at all."""

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import Session

REPLICA = (
    "it is a replica, or the server is in recovery: use the primary server"
    " (several hosts: postgresql://USER@HOST1,HOST2/DATABASE)"
)
READ_ONLY = "it is read-only: {} default_transaction_read_only, or use another server"
#: where PostgreSQL found the setting (pg_settings.source) -> what takes it back
_RESET = {
    "database": "ALTER DATABASE … RESET",
    "user": "ALTER ROLE … RESET",
    "database user": "ALTER ROLE … IN DATABASE … RESET",
    "client": "take out of the URL or PGOPTIONS",
}
_OF_SERVER = "ALTER SYSTEM RESET"


def check_writable(session: Session) -> None:
    """Raise PostgresError if nothing can be written in a session."""
    ((is_replica, is_read_only, source),) = session.execute(
        "SELECT pg_is_in_recovery(), current_setting('transaction_read_only') = 'on', source"
        " FROM pg_settings WHERE name = 'default_transaction_read_only'"
    ).fetchall()
    if is_replica:
        raise PostgresError(REPLICA)
    if is_read_only:
        raise PostgresError(READ_ONLY.format(_RESET.get(source, _OF_SERVER)))
