"""A file that one process has for itself, whatever happens to its names.

The lock (flock) is on the file itself, not on one beside it: it holds through hard links, renames
and moves, and the kernel releases it when the process ends, however it ends. On Linux's local file
systems it is independent of the locks (fcntl) that SQLite takes of the same file. For network file
systems see ``network_folder``.
"""

import fcntl
import os
import struct
from contextlib import suppress
from errno import ELOOP, ENOENT
from pathlib import Path

from mav_tasks.basics.errors import StoreError

GONE = "the file was removed or replaced while it was in use: put it back, or end this server"

#: SQLite's shared lock (sqlite.org/src/file/src/os_unix.c), as a struct flock of Linux
_SHARED = struct.pack("hhqqi", fcntl.F_RDLCK, os.SEEK_SET, 0x40000002, 510, 0)

Identity = tuple[int, int]


class InUse(StoreError):
    """Another process has the file."""


class HeldFile:
    """An open and locked file, until ``close``; it is created if it does not exist.

    The constructor raises InUse if another process has it, or OSError.
    """

    def __init__(self, path: Path, *, asked: Path | None = None) -> None:
        """``asked``: a name of ``path`` by which people find the file; links may lead from it."""
        self._asked = asked or path
        # O_NOFOLLOW: a planted symbolic link would let us write to another file
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        try:
            self.fd = os.open(path, flags, 0o600)
        except OSError as error:
            if error.errno == ELOOP:
                raise OSError(ELOOP, f"{path.name} is a symbolic link: remove it") from None
            raise
        try:
            fcntl.flock(self.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._identity = _identity(os.fstat(self.fd))
            self.check()
        except BaseException as error:
            inode = os.fstat(self.fd).st_ino
            os.close(self.fd)
            if isinstance(error, BlockingIOError):
                raise InUse(f"in use by another process{_pid_of_lock(inode)}") from None
            raise

    def __repr__(self) -> str:
        return f"HeldFile({self._asked.name})"

    @property
    def names(self) -> int:
        """How many names (hard links) the file has."""
        return os.fstat(self.fd).st_nlink

    def check(self) -> None:
        """Raise OSError if people no longer find this file by its name."""
        if identity_of(self._asked) != self._identity:
            raise OSError(ENOENT, GONE)

    def leave_as_it_is(self) -> None:
        """Keep SQLite from changing the file, and from deleting its log, when it closes them.

        It would write its log into a file that somebody has put there since. For that it needs the
        file for itself, which it does not get while somebody else reads, as this lock says.
        """
        fcntl.fcntl(self.fd, fcntl.F_OFD_SETLK, _SHARED)

    def close(self) -> None:
        """Release the file. Closing it also ends fcntl's locks of this process: SQLite's."""
        os.close(self.fd)


def identity_of(path: Path) -> Identity | None:
    """Return device and inode of a file; None: it is not there."""
    try:
        return _identity(path.stat())
    except OSError:
        return None


def _pid_of_lock(inode: int) -> str:
    """Return the words for the process that has locked a file; "" if the kernel does not say it.

    proc_locks(5); the number is 0 for a process in another container.
    """
    with suppress(OSError):
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            _, kind, *_, pid, place, _, _ = line.split()
            if kind == "FLOCK" and place.endswith(f":{inode}") and pid != "0":
                return f", pid {pid}"
    return ""


def _identity(found: os.stat_result) -> Identity:
    return found.st_dev, found.st_ino
