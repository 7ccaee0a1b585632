"""Atomic file writes: a reader sees the old or the new contents, also after a crash."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from typing import BinaryIO

FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW


def write_whole(path: Path, text: str) -> None:
    """Write or replace a file; raise OSError, with the old contents in place, if that fails.

    An existing file keeps its mode; a new one gets the umask's. A symbolic link is followed. A
    terminal or a pipe is written to directly.
    """
    path = Path(os.path.realpath(path))  # Path.resolve raises another error for a symlink loop
    mode = _mode_of(path)
    if mode is not None and not stat.S_ISREG(mode):
        path.write_text(text, encoding="utf-8")
        return
    replace_whole(path, text, mode=0o666, kept=None if mode is None else stat.S_IMODE(mode))


def replace_whole(path: Path, text: str, *, mode: int, kept: int | None = None) -> None:
    """Put a new file in the place of a file or link; raise OSError as ``write_whole`` does.

    It has the mode ``kept``; None: ``mode``, without what the umask forbids.
    """
    with replacing(path, mode=mode, kept=kept) as file:
        file.write(text.encode())


@contextmanager
def replacing(path: Path, *, mode: int, kept: int | None = None) -> Iterator[BinaryIO]:
    """Open a new file beside ``path``, which takes its place when the block ends.

    After an exception the new file is removed, and the old contents are in place. Modes are as in
    ``replace_whole``.
    """
    beside = path.with_name(f".{path.name[:100]}.{token_hex(8)}")
    fd = os.open(beside, FLAGS, mode)
    try:
        with os.fdopen(fd, "wb") as file:
            yield file
            file.flush()
            if kept is not None:
                os.fchmod(fd, kept)
            os.fsync(fd)
        beside.replace(path)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise


def _mode_of(path: Path) -> int | None:
    try:
        return path.stat().st_mode
    except FileNotFoundError:
        return None
