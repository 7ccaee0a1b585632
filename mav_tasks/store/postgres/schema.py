"""The tables of a database, in a schema of their own; ``versions`` has the number of what they are.

An older server wrote a row for each conversion; the highest number counts.
"""

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import SCHEMA, Session
from mav_tasks.store.tables import Tables

LOCK = 0x4D565453_00000002  # of the process that makes or converts tables; others wait
#: the comment of the table ``versions``; keeps us from writing to another program's tables
MARK = "mav-tasks store"
TABLES = Tables(
    "postgresql",
    8,
    {
        "BIG": "BIGINT",
        "REAL": "DOUBLE PRECISION",
        "ID": "BIGINT GENERATED ALWAYS AS IDENTITY",
        # that of the server that wrote the row: ``ownership`` sets the parameter
        "EPOCH": ", epoch BIGINT NOT NULL DEFAULT current_setting('mav_tasks.epoch')::bigint",
    },
)


def version_of(session: Session) -> int:
    """Return the number of the tables that the database has; 0: it has none.

    Raise PostgresError if the schema is another program's, or of a version that does not fit.
    """
    mark, tables = session.execute(
        "SELECT obj_description(to_regclass(?), 'pg_class'),"
        " (SELECT count(*) FROM pg_class WHERE relnamespace = to_regnamespace(?))",
        (f"{SCHEMA}.versions", SCHEMA),
    ).fetchall()[0]
    if mark != MARK:
        if tables:
            raise PostgresError(
                f"its schema {SCHEMA} has tables of another program: use another database"
            )
        return 0
    ((version,),) = session.execute("SELECT coalesce(max(version), 0) FROM versions").fetchall()
    if why := TABLES.refusal(version):
        raise PostgresError(why)
    return int(version)


def migrate(session: Session) -> None:
    """Create the schema and its tables, or bring them up to date."""
    if version_of(session) == TABLES.schema:
        return
    with session.transaction():
        session.execute("SELECT pg_advisory_xact_lock(?)", (LOCK,))
        found = version_of(session)
        if found == TABLES.schema:  # another process was quicker
            return
        if not found:
            _create(session)
        for statement in TABLES.statements(found):
            session.execute(statement)
        session.execute("INSERT INTO versions (version) VALUES (?)", (TABLES.schema,))


def _create(session: Session) -> None:
    """Create the schema, unless an operator has, and the table of versions."""
    if session.execute("SELECT to_regnamespace(?)", (SCHEMA,)).fetchall() == [(None,)]:
        session.execute(f"CREATE SCHEMA {SCHEMA}")
    session.execute(
        f"CREATE TABLE {SCHEMA}.versions (version INTEGER PRIMARY KEY,"
        " applied TIMESTAMPTZ NOT NULL DEFAULT now())"
    )
    session.execute(f"COMMENT ON TABLE {SCHEMA}.versions IS '{MARK}'")
