"""The notes that name the stores of this user's servers; ``mav-tasks log`` reads them."""

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from platformdirs import user_state_path

from mav_tasks.basics.whole_file import write_whole

LATEST = "latest-store"  # of the server that was started last
RUNNING = "server-*.store"  # of one process each, which holds a lock on it as long as it runs


def note_latest(place: str) -> None:
    """Write notes of the starting server's store; ignore a failure to write them.

    The lock on the note of this process ends with the process.
    """
    folder = _folder()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        for note in folder.glob(RUNNING):
            if not _is_locked(note):
                note.unlink()
        write_whole(folder / LATEST, f"{place}\n")
        own = folder / RUNNING.replace("*", str(os.getpid()))
        write_whole(own, f"{place}\n")
        fcntl.flock(os.open(own, os.O_RDONLY | os.O_CLOEXEC), fcntl.LOCK_EX | fcntl.LOCK_NB)


def latest_store() -> str | None:
    """Return the place of the store of the latest server that runs, else that ran; None: none."""
    folder = _folder()
    with suppress(OSError, ValueError):
        running = [note for note in folder.glob(RUNNING) if _is_locked(note)]
        latest = max(running, key=lambda note: note.stat().st_mtime, default=folder / LATEST)
        return latest.read_text(encoding="utf-8").rstrip("\n") or None
    return None


def _is_locked(note: Path) -> bool:
    number = os.open(note, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(number)
    return False


def _folder() -> Path:
    return user_state_path("mav-tasks", appauthor=False)
