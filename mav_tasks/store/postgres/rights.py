"""Which rights on the schema a role lacks: told at the start, not when a task cannot be stored.

PostgreSQL's own errors name a table, but not the right.
"""

from collections.abc import Sequence

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import SCHEMA, Session

MOST = 3  # tables that are named for each right

_ON_SCHEMA = (
    "SELECT current_user::text, has_schema_privilege(oid, 'USAGE'),"
    " has_schema_privilege(oid, 'CREATE') FROM pg_namespace WHERE nspname = ?"
)
#: versions and gateway_secret are written only with the tables themselves, by their owner
_ON_TABLES = (
    "SELECT needed, array_agg(relname::text ORDER BY relname) FROM pg_class, unnest("
    "CASE WHEN relkind = 'S' THEN '{USAGE}'"
    " WHEN relname IN ('versions', 'gateway_secret') THEN '{SELECT}'"
    " ELSE '{SELECT,INSERT,UPDATE,DELETE}' END::text[]) AS needed"
    " WHERE relnamespace = to_regnamespace(?)"
    " AND (relkind = 'r' OR relkind = 'S' AND relname = 'gateway_epochs')"
    " AND NOT CASE WHEN relkind = 'S' THEN has_sequence_privilege(oid, needed)"
    " ELSE has_table_privilege(oid, needed) END GROUP BY needed ORDER BY needed"
)
_TABLES = "SELECT count(*) FROM pg_class WHERE relnamespace = to_regnamespace(?) AND relkind = 'r'"


def check_rights(session: Session) -> None:
    """Raise PostgresError if the session's role may not use the schema, or write its tables.

    A schema that is missing is no error: whoever makes it owns it.
    """
    found = session.execute(_ON_SCHEMA, (SCHEMA,)).fetchone()
    if found is None:
        return
    role, may_use, may_create = found
    ((tables,),) = session.execute(_TABLES, (SCHEMA,)).fetchall()
    right = "USAGE" if not may_use else "CREATE"
    if not may_use or not (may_create or tables):
        raise _lacks(role, f"{right} on the schema", f"{right} ON SCHEMA {SCHEMA}")
    lacking = session.execute(_ON_TABLES, (SCHEMA,)).fetchall()
    if lacking:
        told = "; ".join(f"{right} on {_named(names)}" for right, names in lacking)
        if lacking[-1][0] == "USAGE" and len(lacking) == 1:
            raise _lacks(role, told, f"USAGE ON ALL SEQUENCES IN SCHEMA {SCHEMA}")
        rights = "SELECT, INSERT, UPDATE, DELETE"
        raise _lacks(role, told, f"{rights} ON ALL TABLES IN SCHEMA {SCHEMA}")


def _lacks(role: str, what: str, grant: str) -> PostgresError:
    return PostgresError(
        f"the role {role} lacks {what}: GRANT {grant} TO {role},"
        f" or use the role that owns the schema {SCHEMA}"
    )


def _named(names: Sequence[str]) -> str:
    more = len(names) - MOST
    return ", ".join(names[:MOST]) + (f" and {more} more" if more > 0 else "")
