"""The rotating files of a telemetry log: bounded in size and number."""

import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from mav_tasks.basics.folders import make_private
from mav_tasks.recording.new_files import new_file, write_all

SUFFIX = ".tlog"
OURS = re.compile(r"(\d{4}-\d\d-\d\dT\d\d-\d\d-\d\dZ)(?:\.(\d+))?\.tlog")
CHUNK = 1 << 16  # bytes written at once


class TlogFiles:
    """A log's files, written by one thread. After an OSError of ``write`` they stay readable."""

    def __init__(
        self,
        folder: Path,
        *,
        size: int,
        count: int,
        start: str,
        write: Callable[[int, bytes], None] = write_all,
    ) -> None:
        self._folder = folder
        self._size = size
        self._count = count
        self._write_all = write
        self._start = start  # time of the run's start, in file names
        self._number = -1
        self._fd: int | None = None
        self._path = folder
        self._written = 0  # bytes of whole packets in this file
        self.kept = 0  # packets, in all files

    def __repr__(self) -> str:
        return f"TlogFiles({self._path}, {self._written} bytes, {self.kept} packets)"

    def write(self, packets: Sequence[bytes]) -> None:
        """Write packets that begin with their times."""
        chunk: list[bytes] = []
        length = 0
        for packet in packets:
            fits = self._fd is not None and self._written + length + len(packet) <= self._size
            if chunk and (length > CHUNK or not fits):
                self._keep(chunk)
                chunk, length = [], 0
            chunk.append(packet)
            length += len(packet)
        if chunk:
            self._keep(chunk)

    def close(self) -> None:
        """Close the file; call it last."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None

    def _keep(self, chunk: Sequence[bytes]) -> None:
        data = b"".join(chunk)
        is_full = self._written > 0 and self._written + len(data) > self._size
        # a user, or another server, may have removed the file
        if self._fd is None or is_full or os.fstat(self._fd).st_nlink == 0:
            self._begin()
        assert self._fd is not None
        try:
            self._write_all(self._fd, data)
        except OSError:
            self._cut_back(self._fd)
            raise
        self._written += len(data)
        self.kept += len(chunk)

    def _begin(self) -> None:
        self.close()
        make_private(self._folder)  # it may have been removed
        self._fd, self._path, self._number = new_file(
            self._folder, self._start, self._number + 1, SUFFIX
        )
        self._written = 0
        self._forget_oldest()

    def _cut_back(self, fd: int) -> None:
        """Remove a partly written packet: readers would lose synchronization."""
        try:
            os.ftruncate(fd, self._written)
            os.lseek(fd, self._written, os.SEEK_SET)
        except OSError:  # then the next packets go to a new file
            self.close()

    def _forget_oldest(self) -> None:
        """Delete the oldest files above the limit, only those with names of our form."""
        found = [
            ((match[1], int(match[2] or 0)), path)
            for path in self._folder.iterdir()
            if (match := OURS.fullmatch(path.name)) is not None
            and path != self._path
            and path.is_file()
            and not path.is_symlink()
        ]
        for _, path in sorted(found)[: max(0, len(found) + 1 - self._count)]:
            with suppress(OSError):  # the next file tries again
                path.unlink()
