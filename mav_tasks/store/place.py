"""The path of a store: the default one, and the one that the latest server uses."""

from contextlib import suppress
from pathlib import Path

from platformdirs import user_data_path, user_state_path

from mav_tasks.whole_file import write_whole

IN_MEMORY = ":memory:"
DEFAULT_STORE = "mav-tasks.sqlite3"


def path_of_store(text: str | None) -> Path | None:
    """Return a store's path: for "" or None in the user's data folder; None for IN_MEMORY."""
    if text == IN_MEMORY:
        return None
    return Path(text) if text else user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE


def note_latest(store: Path | None) -> None:
    """Write a note of the starting server's store; None: in memory.

    ``mav-tasks log`` reads the note to find the running server's journal. A failure to write the
    note is ignored.
    """
    note = _note()
    with suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True)
        write_whole(note, f"{IN_MEMORY if store is None else store.expanduser().absolute()}\n")


def latest_store() -> str | None:
    """Return the store of the latest server: a path, or IN_MEMORY; None if there is no note."""
    try:
        return _note().read_text(encoding="utf-8").rstrip("\n") or None
    except (OSError, ValueError):
        return None


def _note() -> Path:
    return user_state_path("mav-tasks", appauthor=False) / "latest-store"
