"""The tables of a database, in a schema of their own, and the migrations of older ones.

The table ``versions`` has a row for each migration that was applied. A changed table, or a changed
meaning of a stored name (goal, state, field), needs a new migration at the end of the list;
released migrations are never edited. A new field, goal or event needs no migration: see ``codec``.
The tables are those of SQLite (``store/schema.py``); what is different is commented here.
"""

from collections.abc import Sequence

from mav_tasks.store.postgres.failures import PostgresError
from mav_tasks.store.postgres.session import SCHEMA, Session

LOCK = 0x4D565453_00000002  # of whoever migrates: gateways may begin at the same time
#: the comment of the table ``versions``; keeps us from writing to another program's tables
MARK = "mav-tasks store"

#: each is the statements of one transaction. Times are UTC seconds, texts are rows of ``codec``.
#: ``epoch`` of a row is that of the server that wrote it: ``ownership`` sets the parameter.
_EPOCH = "epoch BIGINT NOT NULL DEFAULT current_setting('mav_tasks.epoch')::bigint"
MIGRATIONS: tuple[tuple[str, ...], ...] = (
    (
        (  # the server that writes
            "CREATE TABLE writer (one INTEGER PRIMARY KEY CHECK (one = 1), epoch BIGINT NOT NULL,"
            " host TEXT NOT NULL, pid BIGINT NOT NULL, since DOUBLE PRECISION NOT NULL)"
        ),
        "INSERT INTO writer VALUES (1, 0, '', 0, 0)",
        (  # fleet: names the halt record, a file on each server's machine
            "CREATE TABLE meta (one INTEGER PRIMARY KEY CHECK (one = 1),"
            " fleet TEXT NOT NULL DEFAULT gen_random_uuid()::text,"
            " next_id BIGINT NOT NULL, last_number BIGINT NOT NULL, last_write DOUBLE PRECISION,"
            " ended_well INTEGER NOT NULL, signed_until BIGINT NOT NULL)"
        ),
        (
            "INSERT INTO meta (one, next_id, last_number, ended_well, signed_until)"
            " VALUES (1, 1, 0, 1, 0)"
        ),
        (  # names are longer than an index takes
            "CREATE TABLE formats (id BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,"
            " names TEXT NOT NULL)"
        ),
        (
            "CREATE TABLE tasks (id BIGINT PRIMARY KEY, number BIGINT NOT NULL,"
            " vehicle BIGINT NOT NULL, state INTEGER NOT NULL,"
            " changed_at DOUBLE PRECISION NOT NULL, submitted TEXT NOT NULL, changed TEXT,"
            f" modified TEXT, advanced TEXT, {_EPOCH})"
        ),
        "CREATE INDEX finished ON tasks (changed_at) WHERE state >= 9",
        (
            "CREATE TABLE journal (number BIGINT PRIMARY KEY, utc DOUBLE PRECISION NOT NULL,"
            f" kind TEXT NOT NULL, task_id BIGINT, vehicle BIGINT, body TEXT NOT NULL, {_EPOCH})"
        ),
        "CREATE INDEX of_task ON journal (task_id) WHERE task_id IS NOT NULL",
        "CREATE INDEX of_no_task ON journal (number) WHERE task_id IS NULL",  # they are counted
        (
            "CREATE TABLE vehicles (vehicle BIGINT PRIMARY KEY, paused INTEGER, uid TEXT,"
            " speed DOUBLE PRECISION, home TEXT, halt_epoch BIGINT, may_arm INTEGER,"
            " halt_reason INTEGER, halted_utc DOUBLE PRECISION)"
        ),
        (
            "CREATE TABLE plans (vehicle BIGINT NOT NULL, kind INTEGER NOT NULL,"
            " plan_id BIGINT NOT NULL, source TEXT NOT NULL, PRIMARY KEY (vehicle, kind))"
        ),
        "CREATE TABLE parameters (name TEXT PRIMARY KEY, value DOUBLE PRECISION)",
        (
            "CREATE TABLE signatures (key TEXT NOT NULL, link_id INTEGER NOT NULL,"
            " system_id INTEGER NOT NULL, component_id INTEGER NOT NULL, timestamp BIGINT NOT NULL,"
            " PRIMARY KEY (key, link_id, system_id, component_id))"
        ),
    ),
    (  # gateways that share a fleet: fleet_io/lease_database.py
        (  # epoch 0: not in the fleet; backend: of the session that asked last
            "CREATE TABLE gateways (number INTEGER GENERATED ALWAYS AS IDENTITY PRIMARY KEY,"
            " name TEXT NOT NULL UNIQUE, epoch BIGINT NOT NULL DEFAULT 0,"
            " renewals BIGINT NOT NULL DEFAULT 0, backend INTEGER NOT NULL DEFAULT 0,"
            " host TEXT NOT NULL DEFAULT '', port INTEGER NOT NULL DEFAULT 0,"
            " machine TEXT NOT NULL DEFAULT '', pid BIGINT NOT NULL DEFAULT 0,"
            " since DOUBLE PRECISION NOT NULL DEFAULT 0)"
        ),
        "CREATE SEQUENCE gateway_epochs AS BIGINT",
        (  # gateway NULL: free; number: of the takeover, a fence that only rises
            "CREATE TABLE holdings (vehicle BIGINT PRIMARY KEY,"
            " gateway INTEGER REFERENCES gateways, number BIGINT NOT NULL,"
            " signing_time BIGINT NOT NULL DEFAULT 0)"
        ),
        "CREATE INDEX held_by ON holdings (gateway) WHERE gateway IS NOT NULL",
        (  # authenticates the pings between gateways
            "CREATE TABLE gateway_secret (one INTEGER PRIMARY KEY CHECK (one = 1),"
            " secret TEXT NOT NULL)"
        ),
        (
            "INSERT INTO gateway_secret"
            " VALUES (1, gen_random_uuid()::text || gen_random_uuid()::text)"
        ),
    ),
    (  # a store that gateways share: fleet_database.py
        (  # not in gateways: a write that hangs must not keep that gateway from its renewals
            "CREATE TABLE gateway_writes (gateway INTEGER PRIMARY KEY REFERENCES gateways,"
            " epoch BIGINT NOT NULL, written BIGINT NOT NULL)"
        ),
        "CREATE INDEX by_number ON tasks (number)",  # ids do not increase with it in a fleet
        "CREATE INDEX not_over ON tasks (vehicle) WHERE state < 9",
        (  # s by which the holder signs ahead of its clock, as of a time: a fence at the vehicle
            "ALTER TABLE holdings DROP COLUMN signing_time,"
            " ADD COLUMN lead DOUBLE PRECISION NOT NULL DEFAULT 0,"
            " ADD COLUMN lead_utc DOUBLE PRECISION NOT NULL DEFAULT 0"
        ),
    ),
    (  # vehicles that a gateway hears and does not hold: their gateway may free them
        "ALTER TABLE gateways ADD COLUMN hears BIGINT[] NOT NULL DEFAULT '{}'",
    ),
    (  # the task before it, perhaps another gateway's: dependencies.py
        "ALTER TABLE tasks ADD COLUMN run_after BIGINT",
        "CREATE INDEX expected ON tasks (run_after) WHERE run_after IS NOT NULL",
    ),
    (  # tasks that any vehicle may drive: fleet_nonces.py
        "ALTER TABLE tasks ADD COLUMN assigned TEXT",
        (
            "CREATE TABLE nonces (key TEXT NOT NULL, system_id INTEGER NOT NULL,"
            " component_id INTEGER NOT NULL, nonce BIGINT NOT NULL, payload TEXT NOT NULL,"
            " task_id BIGINT NOT NULL, PRIMARY KEY (key, system_id, component_id, nonce))"
        ),
        "CREATE INDEX of_nonce ON nonces (task_id)",
    ),
    (  # 0: not known, of an older server
        "ALTER TABLE gateways ADD COLUMN system_id INTEGER NOT NULL DEFAULT 0",
    ),
    (  # they are counted
        "CREATE INDEX of_kind ON journal (kind, task_id)",
        "DROP INDEX of_no_task",
    ),
)


def version_of(session: Session) -> int:
    """Return how many migrations the database has; 0: it is empty.

    Raise PostgresError if the schema is another program's, or a newer version's.
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
    known = len(MIGRATIONS)
    if version > known:
        raise PostgresError(
            f"written by a newer version (schema {version}, this one knows {known}):"
            " install that version here, too"
        )
    return int(version)


def migrate(session: Session, *, migrations: Sequence[Sequence[str]] = MIGRATIONS) -> None:
    """Create the schema, or apply the missing migrations."""
    for number in range(version_of(session), len(migrations)):
        with session.transaction():
            session.execute("SELECT pg_advisory_xact_lock(?)", (LOCK,))
            if version_of(session) > number:  # another process was quicker
                continue
            if number == 0:
                _create(session)
            for statement in migrations[number]:
                session.execute(statement)
            session.execute("INSERT INTO versions (version) VALUES (?)", (number + 1,))


def _create(session: Session) -> None:
    """Create the schema, unless an operator has, and the table of versions."""
    if session.execute("SELECT to_regnamespace(?)", (SCHEMA,)).fetchall() == [(None,)]:
        session.execute(f"CREATE SCHEMA {SCHEMA}")
    session.execute(
        f"CREATE TABLE {SCHEMA}.versions (version INTEGER PRIMARY KEY,"
        " applied TIMESTAMPTZ NOT NULL DEFAULT now())"
    )
    session.execute(f"COMMENT ON TABLE {SCHEMA}.versions IS '{MARK}'")
