"""The recordings in a folder, for the page: which runs there are, and one run's path on the map."""

import asyncio
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mav_tasks.basics.errors import UsageError
from mav_tasks.recording.decisions import SUFFIX
from mav_tasks.web.problems import Problem, not_found

TLOG = ".tlog"
WITHIN = 120.0  # s to read a run
MOST_BYTES = 64 << 20  # of a run as JSON
MOST_WAITING = 5  # requests for a run at a time; more are refused
MOST = 500  # runs that are listed, the newest


@dataclass(frozen=True, slots=True)
class Files:
    """The files of one run."""

    name: str
    paths: tuple[Path, ...]

    @property
    def form(self) -> dict[str, Any]:
        """The run as JSON."""
        found = [path.stat() for path in self.paths]
        return {
            "name": self.name,
            "bytes": sum(each.st_size for each in found),
            "changed": max(each.st_mtime for each in found),
            "files": [_shown(path.name) for path in self.paths],
        }


class Records:
    """The runs in a folder. One is read at a time."""

    def __init__(self, folder: Path) -> None:
        if not folder.is_dir():
            raise UsageError(f"--records {folder}: no such folder")
        self._folder = folder
        self._reading = asyncio.Lock()
        self._waiting = 0

    def __repr__(self) -> str:
        return f"Records({self._folder})"

    def forms(self) -> list[dict[str, Any]]:
        """Return the runs, the newest first. Blocks; raise Problem if the folder is unreadable."""
        try:
            forms = [each.form for each in self._runs().values()]
        except OSError as error:
            words = f"{self._folder}: {error.strerror}"
            raise Problem(503, "Recordings cannot be read", words) from error
        return sorted(forms, key=lambda form: form["changed"], reverse=True)[:MOST]

    async def run(self, name: str) -> bytes:
        """Return a run as JSON. Raise Problem if there is no such run, or it is unreadable."""
        files = (await asyncio.to_thread(self._runs)).get(name)
        if files is None:
            raise not_found(f"there is no recording {name[:80]!r}")
        if self._waiting >= MOST_WAITING:
            words = "other recordings are being read: try again"
            raise Problem(503, "Busy", words, headers={"retry-after": "5"})
        self._waiting += 1
        try:
            async with self._reading:
                return await _read(files)
        finally:
            self._waiting -= 1

    def _runs(self) -> dict[str, Files]:
        found: dict[str, list[Path]] = {}
        for path in sorted(self._folder.iterdir()):
            for suffix in (TLOG, SUFFIX):
                if path.name.endswith(suffix) and path.is_file():
                    found.setdefault(_shown(path.name.removesuffix(suffix)), []).append(path)
        return {name: Files(name, tuple(paths)) for name, paths in found.items()}


def _shown(name: str) -> str:
    """Return the name of a file as text: the disk may have any bytes."""
    return name.encode(errors="replace").decode()


async def _read(files: Files) -> bytes:
    command = [sys.executable, "-m", "mav_tasks.web.recorded", *map(str, files.paths)]
    reading = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    assert reading.stdout is not None, "it is a pipe"
    assert reading.stderr is not None, "so is it"
    data = bytearray()
    try:
        async with asyncio.timeout(WITHIN):
            while piece := await reading.stdout.read(1 << 20):
                data += piece
                if len(data) > MOST_BYTES:
                    words = f"{files.name}: more than {MOST_BYTES >> 20} MB to show"
                    raise Problem(422, "Recording is too large", words)
            words = (await reading.stderr.read()).decode(errors="replace")
            await reading.wait()
    except TimeoutError:
        raise Problem(504, "Too long", f"{files.name}: not read within {WITHIN:g} s") from None
    finally:
        if reading.returncode is None:
            reading.kill()
            await reading.wait()
    if reading.returncode:
        detail = words.strip().rpartition("\n")[2]
        # the folder is the server's own affair
        detail = detail.replace(f"{files.paths[0].parent}{os.sep}", "")
        raise Problem(422, "Recording cannot be read", detail[:500])
    return bytes(data)
