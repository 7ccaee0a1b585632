"""One server owns a store: a lock on a file beside it, which ends with the process however it ends.

The file stays when the lock goes: who removed it could remove one that another has just locked.
"""

import errno
import fcntl
import os
from contextlib import suppress
from pathlib import Path

from mav_tasks.errors import StoreError


class Lock:
    """Held from its making until ``release``. StoreError: another process has it, or no file."""

    def __init__(self, store: Path) -> None:
        self._fd: int | None = None
        path = store.with_name(f"{store.name}.lock")
        try:
            # never through a link: whoever planted it would have another file cut off
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            if error.errno == errno.ELOOP:
                words = f"{path.name} is a symbolic link: remove it"
                raise StoreError(f"store {store}: {words}") from None
            raise StoreError(f"store {store}: {path.name}: {error.strerror}") from error
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.read(fd, 20).decode("ascii", "replace").strip()
            os.close(fd)
            raise StoreError(
                f"store {store}: in use by another process"
                + (f", pid {holder}" if holder.isdecimal() else "")
            ) from None
        except OSError as error:
            os.close(fd)
            raise StoreError(f"store {store}: cannot be locked: {error.strerror}") from error
        self._fd = fd
        with suppress(OSError):  # a full disk: the number is for the message only
            os.ftruncate(fd, 0)
            os.pwrite(fd, f"{os.getpid()}\n".encode("ascii"), 0)

    def __repr__(self) -> str:
        return "Lock(held)" if self._fd is not None else "Lock(released)"

    def release(self) -> None:
        """Let others have it."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None
