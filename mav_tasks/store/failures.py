"""Disk failures, and texts for them. Other sqlite3 errors are bugs of ours, and are raised."""

import sqlite3

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


def is_failure(error: Exception) -> bool:
    """Whether an error is a disk failure, which may be temporary, and not a bug."""
    return isinstance(error, OSError) or type(error) in (
        sqlite3.OperationalError,
        sqlite3.DatabaseError,  # itself: damage; its other subclasses: misuse
    )


def words_for(error: Exception) -> str:
    if isinstance(error, OSError):
        return error.strerror or str(error)
    words = _WORDS.get(getattr(error, "sqlite_errorcode", 0) & 0xFF)
    return f"{words} ({error})" if words else str(error)
