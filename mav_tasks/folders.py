"""Folders for what is its owner's alone: keys, records, the store."""

from pathlib import Path


def make_private(folder: Path) -> None:
    """Make a folder unless it is there, and those above it that are not, for nobody else to enter.

    ``Path.mkdir`` gives those above what the umask leaves, which may be everything. OSError.
    """
    missing = [each for each in folder.parents if not each.exists()]
    for each in (*reversed(missing), folder):
        each.mkdir(mode=0o700, exist_ok=True)
