"""Where the halt record of a store in PostgreSQL is: a file on this machine."""

import re
from pathlib import Path

from platformdirs import user_data_path

from mav_tasks.basics.errors import StoreError
from mav_tasks.basics.folders import make_private


def local_path(database: str, fleet: str, *, name: str) -> Path:
    """Return the path beside which the halt record is: in the user's data folder.

    A copy of the ``database`` under another name has another record. ``name`` is what people call
    the store. Raise StoreError if the folder cannot be made.
    """
    folder = user_data_path("mav-tasks", appauthor=False)
    try:
        make_private(folder)
    except OSError as error:
        raise StoreError(f"store {name}: {folder} cannot be created: {error.strerror}") from error
    plain = re.sub(r"[^A-Za-z0-9_-]", "_", database)
    return folder / f"{plain}-{fleet[:8]}"
