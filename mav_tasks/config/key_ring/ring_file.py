"""The key ring's file: it is refused unless only its user can read and write it."""

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import NamedTuple

from platformdirs import user_config_path

from mav_tasks.basics.errors import ConfigError, KeyRingError
from mav_tasks.basics.folders import make_private
from mav_tasks.basics.whole_file import replace_whole
from mav_tasks.config.key_ring.ring import KeyRing
from mav_tasks.config.key_ring.toml_form import ring_of, text_of
from mav_tasks.config.toml_file import LARGEST, decoded

FILE_NAME = "keys.toml"
OTHERS = stat.S_IRWXG | stat.S_IRWXO

#: identifies a version of a file: device, inode, mtime, ctime, size
Mark = tuple[int, int, int, int, int]


class Loaded(NamedTuple):
    """A ring, and the mark of its file."""

    ring: KeyRing
    mark: Mark


def path_of_ring(text: str) -> Path:
    """Return the ring's path, for "" in the user's configuration folder; raise KeyRingError."""
    if not text:
        return user_config_path("mav-tasks", appauthor=False) / FILE_NAME
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise KeyRingError(f"{text}: {error}") from None


def mark_of(found: os.stat_result) -> Mark:
    times = (found.st_mtime_ns, found.st_ctime_ns)
    return (found.st_dev, found.st_ino, *times, found.st_size)


def load(path: Path) -> Loaded:
    """Read a ring; raise KeyRingError if it is unreadable, not private or invalid."""
    try:
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # never block on a pipe
        try:
            found = os.fstat(number)
            _check(path, found)
            with os.fdopen(number, "rb", closefd=False) as file:
                data = file.read(LARGEST + 1)
        finally:
            os.close(number)
    except FileNotFoundError:
        raise KeyRingError(
            f"key ring {path} does not exist; mav-tasks keys add creates one"
        ) from None
    except OSError as error:
        raise KeyRingError(f"key ring {path}: {error.strerror}") from error
    try:
        text = decoded(data, name=str(path))
    except ConfigError as error:
        raise KeyRingError(*error.faults) from None
    return Loaded(ring_of(text, name=str(path)), mark_of(found))


def change(path: Path, to: Callable[[KeyRing], KeyRing]) -> None:
    """Replace a ring, or an empty one if there is no file, by ``to(ring)``; raise KeyRingError.

    The change is atomic for readers, and a lock serializes concurrent changes.
    """
    try:
        path = path.resolve()  # a symbolic link stays
        make_private(path.parent)
        with _locked(path.parent):
            ring = load(path).ring if path.exists() else KeyRing()
            replace_whole(path, text_of(to(ring)), mode=0o600)
    except (OSError, RuntimeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "too many links"
        raise KeyRingError(f"key ring {path}: {reason}") from error


def _check(path: Path, found: os.stat_result) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise KeyRingError(f"key ring {path}: not a file")
    if found.st_uid != os.geteuid():
        raise KeyRingError(
            f"key ring {path} belongs to another user; it must belong to the user who reads it"
        )
    if found.st_mode & OTHERS:
        mode = stat.S_IMODE(found.st_mode)
        raise KeyRingError(
            f"key ring {path}: other users can access it (mode {mode:04o}): chmod 600 {path}, "
            "and if they could read it, replace the keys"
        )


@contextmanager
def _locked(folder: Path) -> Iterator[int]:
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        flock(number, LOCK_EX)
        yield number
        os.fsync(number)
    finally:
        os.close(number)
