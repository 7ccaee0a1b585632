"""Disk failures of SQLite, and texts for them. Its other errors are bugs of ours."""

import sqlite3

from mav_tasks.store.holder import Replaced

#: SQLite's primary result codes (sqlite.org/rescode.html)
_WORDS = {
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_READONLY: "it is read-only",
    sqlite3.SQLITE_IOERR: "the disk cannot be read or written, or is full",
    sqlite3.SQLITE_CORRUPT: "it is damaged",
    sqlite3.SQLITE_NOTADB: "it is damaged, or not a database",
    sqlite3.SQLITE_CANTOPEN: "it cannot be opened",
    sqlite3.SQLITE_BUSY: "another program has locked it",
    sqlite3.SQLITE_LOCKED: "another program has locked it",
    sqlite3.SQLITE_PERM: "permission denied",
}


def failure(error: Exception) -> str | None:
    """Return the words for a disk failure, which may be temporary; None: it is a bug of ours."""
    if isinstance(error, Replaced):
        return str(error)
    if isinstance(error, OSError):
        return words_for(error)
    if type(error) not in (
        sqlite3.OperationalError,
        sqlite3.DatabaseError,  # itself: damage; its other subclasses: misuse
    ):
        return None
    words = _WORDS.get(getattr(error, "sqlite_errorcode", 0) & 0xFF)
    return f"{words} ({error})" if words else str(error)


def words_for(error: OSError) -> str:
    return error.strerror or str(error)
