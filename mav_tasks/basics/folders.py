"""Private folders, for keys, records and the store."""

from pathlib import Path

from mav_tasks.basics.errors import UsageError


def at_home(text: str, *, what: str) -> Path:
    """Return a typed path with its ~ replaced. Raise UsageError if there is no such user."""
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise UsageError(f"{what} {text}: {error}") from None


def make_private(folder: Path) -> None:
    """Create a folder and its missing parents with mode 0700; raise OSError if that fails.

    ``Path.mkdir(parents=True)`` would create the parents with the mode that the umask allows, which
    may let everybody in. Folders that exist keep their mode.
    """
    missing = [each for each in folder.parents if not each.exists()]
    for each in (*reversed(missing), folder):
        each.mkdir(mode=0o700, exist_ok=True)
