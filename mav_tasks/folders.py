"""Private folders, for keys, records and the store."""

from pathlib import Path


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents with mode 0700; raise OSError if that fails.

    ``Path.mkdir(parents=True)`` would create the parents with the mode that the umask allows, which
    may let everybody in. Folders that exist keep their mode.
    """
    missing = [each for each in folder.parents if not each.exists()]
    for each in (*reversed(missing), folder):
        each.mkdir(mode=0o700, exist_ok=True)
