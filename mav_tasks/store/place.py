"""Where a store is, if nobody says where."""

from pathlib import Path

from platformdirs import user_data_path

IN_MEMORY = ":memory:"
DEFAULT_STORE = "mav-tasks.sqlite3"


def path_of_store(text: str | None) -> Path | None:
    """Give where a store is: "" or None is in the user's data folder, IN_MEMORY nowhere, None."""
    if text == IN_MEMORY:
        return None
    return Path(text) if text else user_data_path("mav-tasks", appauthor=False) / DEFAULT_STORE
