"""Failures of a database server, and texts for them that say what to do."""

import re

from mav_tasks.store.holder import Replaced

#: SQLSTATE, or its class -> words (postgresql.org/docs/current/errcodes-appendix.html)
_WORDS = {
    "53100": "the disk of the database is full",
    "53200": "the database server has no memory left",
    "53300": "too many connections: end some, or raise max_connections of the server",
    "53": "the database server lacks a resource",
    "55P03": "another program has locked its tables",
    "57014": "the database took too long",
    "25P04": "the database took too long",
    "57P01": "the database server is shutting down",
    "57P02": "the database server has crashed and restarts",
    "57P03": "the database server is starting or shutting down",
    "25006": "it is read-only",
    "42501": "the role lacks a right: use the role that owns the schema mav_tasks",
    "42P01": "a table is gone",
    "3F000": "its schema mav_tasks is gone",
    "23505": "another program writes to its tables",
    "XX001": "it is damaged",
    "XX002": "it is damaged",
    "58": "the disk of the database cannot be read or written",
}
#: of errors without a SQLSTATE, which come before a connection: a part of the text -> what to do
_ADVICE = (
    (r"database \".*\" does not exist", "create it: createdb --owner=ROLE DATABASE"),
    (r"role \".*\" does not exist", "create it: createuser ROLE"),
    (r"password authentication failed", "check ~/.pgpass, PGPASSWORD or the URL"),
    (r"no password supplied", "put it into ~/.pgpass or PGPASSWORD"),
    (r"no pg_hba\.conf entry", "allow this machine in the server's pg_hba.conf"),
    (r"too many (clients|connections)|remaining connection slots", _WORDS["53300"]),
    (r"permission denied for database", "GRANT CONNECT, CREATE ON DATABASE … TO the role"),
    (r"Connection refused|No such file or directory", "is the server running there?"),
    (r"resolve host|translate host name", "check the host's name in the URL"),
    (r"timeout expired", "check host and port in the URL, and the network"),
    (r"invalid response to SSL negotiation", "is PostgreSQL's port in the URL?"),
    (r"session is read-only|server is in hot standby", "name the primary server in the URL"),
)
#: classes and codes that only a mistake of ours can cause: invalid data, features, statements
_BUGS = ("22", "0A", "42601", "42804", "42P18", "42883", "08P01")
LOST = "08006"
#: of a server that is slow, busy or starts: the next attempt may succeed
_TEMPORARY = (LOST, "53", "55P03", "57014", "57P01", "57P02", "57P03", "25P04")


class PostgresError(Exception):
    """An error of the server, or the loss of its connection (LOST). The text is one line."""

    def __init__(self, text: str, *, sqlstate: str = "", table: str = "", column: str = "") -> None:
        super().__init__(in_one_line(text))
        self.sqlstate = sqlstate
        self.table = table
        self.column = column


def failure(error: Exception) -> str | None:
    """Return the words for a failure, which may be temporary; None: it is a bug of ours."""
    if isinstance(error, Replaced):
        return str(error)
    if not isinstance(error, PostgresError) or error.sqlstate.startswith(_BUGS):
        return None
    code = error.sqlstate
    words = _WORDS.get(code) or _WORDS.get(code[:2])
    if code == "42501" and "for database" in str(error):
        words = "the role may not create the schema mav_tasks: GRANT CREATE ON DATABASE … TO it"
    elif code == "42501" and "must be owner" in str(error):
        words = (
            "this older store must be converted by the role that owns its tables: start a server"
            " of this version once as that role"
        )
    if code == "54000" and "NOTIFY" in str(error):
        words = (
            "the server's queue of notifications is full: end the session that listens and does"
            " not end its transaction (pg_stat_activity)"
        )
    return f"{words} ({error})" if words else str(error)


def is_temporary(error: PostgresError) -> bool:
    """Return whether the next attempt may succeed, without anybody having mended anything."""
    return error.sqlstate.startswith(_TEMPORARY)


def connecting(text: str) -> str:
    """Return the words for a failure to connect, with what to do about it."""
    plain = in_one_line(text)
    advice = next((told for part, told in _ADVICE if re.search(part, plain)), None)
    return f"{plain}: {advice}" if advice else plain


def in_one_line(text: str) -> str:
    """Return the first line of a text of libpq, without its general beginning."""
    first = text.strip().partition("\n")[0].strip()
    for beginning in ("connection failed: ", "connection is bad: ", "consuming input failed: "):
        first = first.removeprefix(beginning)
    return re.sub(r"\b(FATAL|ERROR): +", "", first)
