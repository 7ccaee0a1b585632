"""The lock that gives a store to one server: flock on a file beside the store.

The kernel releases the lock when the process ends, however it ends. The lock file is never removed:
that could remove a file that another process has just locked.
"""

import errno
import fcntl
import os
from contextlib import suppress
from pathlib import Path

from mav_tasks.errors import StoreError


class Lock:
    """A lock, held from creation until ``release``; ``name`` is what people call the store.

    The constructor raises StoreError if another process holds the lock, or the file cannot be
    opened.
    """

    def __init__(self, store: Path, *, name: str) -> None:
        self._fd: int | None = None
        path = store.with_name(f"{store.name}.lock")
        try:
            # O_NOFOLLOW: a planted symbolic link would let us truncate another file
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            if error.errno == errno.ELOOP:
                words = f"{path.name} is a symbolic link: remove it"
                raise StoreError(f"store {name}: {words}") from None
            raise StoreError(f"store {name}: {path.name}: {error.strerror}") from error
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(fd, 20).decode("ascii", "replace").strip()
            os.close(fd)
            raise StoreError(
                f"store {name}: in use by another process"
                + (f", pid {holder}" if holder.isdecimal() else "")
            ) from None
        except OSError as error:
            os.close(fd)
            raise StoreError(f"store {name}: cannot be locked: {error.strerror}") from error
        self._fd = fd
        with suppress(OSError):  # on a full disk; the pid is only for the message
            os.ftruncate(fd, 0)
            os.pwrite(fd, f"{os.getpid()}\n".encode("ascii"), 0)

    def __repr__(self) -> str:
        return "Lock(held)" if self._fd is not None else "Lock(released)"

    def release(self) -> None:
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None
