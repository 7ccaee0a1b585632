"""Private folders and files for records, named by the time of the start."""

import os
from datetime import UTC, datetime
from pathlib import Path

from mav_tasks.basics.errors import RecordError
from mav_tasks.basics.folders import make_private

FLAGS = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC  # O_EXCL follows no symbolic link
MOST_OF_A_NAME = 100_000


def prepared(folder: str) -> Path:
    """Create a folder if it is missing; raise RecordError if it cannot be written to."""
    try:
        path = Path(folder).expanduser().absolute()
    except RuntimeError as error:  # the home folder of an unknown user
        raise RecordError(f"cannot write records to {folder}: {error}") from error
    try:
        make_private(path)
    except FileExistsError as error:
        raise RecordError(f"cannot write records to {path}: not a folder") from error
    except OSError as error:
        raise RecordError(f"cannot write records to {path}: {error.strerror}") from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise RecordError(f"cannot write records to {path}: not writable")
    return path


def stamp(utc: float) -> str:
    """Return a time, seconds since 1970, as text for file names."""
    return f"{datetime.fromtimestamp(max(utc, 0.0), UTC):%Y-%m-%dT%H-%M-%SZ}"


def new_file(folder: Path, start: str, number: int, suffix: str) -> tuple[int, Path, int]:
    """Create a file with the first free number from ``number`` on; raise OSError.

    Return its descriptor, path and number.
    """
    while True:
        path = folder / (f"{start}.{number}{suffix}" if number else f"{start}{suffix}")
        try:
            return os.open(path, FLAGS, 0o600), path, number
        except FileExistsError:
            number += 1
            if number > MOST_OF_A_NAME:
                raise


def write_all(fd: int, data: bytes) -> None:
    """Write all bytes; raise OSError, after which a part may have been written."""
    left = memoryview(data)
    while left:
        left = left[os.write(fd, left) :]
