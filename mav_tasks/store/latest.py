"""The note that names the store of the latest server; ``mav-tasks log`` reads it."""

from contextlib import suppress
from pathlib import Path

from platformdirs import user_state_path

from mav_tasks.whole_file import write_whole


def note_latest(place: str) -> None:
    """Write a note of the starting server's store; ignore a failure to write it."""
    note = _note()
    with suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True)
        write_whole(note, f"{place}\n")


def latest_store() -> str | None:
    """Return the place of the latest server's store; None if there is no note."""
    try:
        return _note().read_text(encoding="utf-8").rstrip("\n") or None
    except (OSError, ValueError):
        return None


def _note() -> Path:
    return user_state_path("mav-tasks", appauthor=False) / "latest-store"
