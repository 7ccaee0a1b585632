"""Exports another revision of the project to a folder, for comparisons."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[2]


def commit_of(revision: str) -> str:
    """Return the full hash of a revision. Raise SystemExit if git does not know it."""
    asked = subprocess.run(
        ["git", "rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if asked.returncode:
        raise SystemExit(f"git knows no revision {revision!r}")
    return asked.stdout.strip()


@contextmanager
def checked_out(revision: str) -> Iterator[Path]:
    """Return a folder with the files of a revision and its generated dialect; it is removed later.

    It is an export, not a git worktree, so nothing is left behind in the repository.
    """
    commit = commit_of(revision)
    with TemporaryDirectory(prefix=f"mav-tasks-{commit[:8]}-") as name:
        folder = Path(name)
        with subprocess.Popen(
            ["git", "archive", "--format=tar", commit], cwd=ROOT, stdout=subprocess.PIPE
        ) as archive:
            subprocess.run(["tar", "-x", "-C", name], stdin=archive.stdout, check=True)
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "--hooks-only"]
        subprocess.run(build, cwd=folder, check=True, capture_output=True)
        yield folder
