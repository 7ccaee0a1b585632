"""Where a store is, if nobody says where; and which one the latest server has."""

from contextlib import suppress
from pathlib import Path

from platformdirs import user_data_path, user_state_path

from mav_tasks.whole_file import write_whole

IN_MEMORY = ":memory:"
DEFAULT_STORE = "mav-tasks.sqlite3"


def path_of_store(text: str | None) -> Path | None:
    """Return where a store is: "" or None is in the user's data folder, IN_MEMORY nowhere, None."""
    if text == IN_MEMORY:
        return None
    return Path(text) if text else user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE


def note_latest(store: Path | None) -> None:
    """Note the store of the server that starts now, None: it keeps nothing.

    So that ``mav-tasks log`` reads the journal of the server that runs, wherever that is. A server
    that cannot write the note serves all the same.
    """
    note = _note()
    with suppress(OSError):
        note.parent.mkdir(parents=True, exist_ok=True)
        write_whole(note, f"{IN_MEMORY if store is None else store.expanduser().absolute()}\n")


def latest_store() -> str | None:
    """Return the store of the server that was started last: a path, or IN_MEMORY; None: no note."""
    try:
        return _note().read_text(encoding="utf-8").rstrip("\n") or None
    except (OSError, ValueError):
        return None


def _note() -> Path:
    return user_state_path("mav-tasks", appauthor=False) / "latest-store"
