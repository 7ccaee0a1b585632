"""The file of a record: a gzip stream with an end mark, readable up to where it was written.

The stream is flushed after each block, so that a crash loses only unwritten blocks. The size limit
reserves room for the end mark; a partly written block is cut off before the mark is written.
"""

import os
import zlib
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any

from mav_tasks.recording.new_files import write_all
from mav_tasks.recording.record_lines import dumps

GZIP = 31  # zlib's window bits that mean gzip
LEVEL = 6
ROOM_OF_END = 1_000  # bytes


@dataclass(frozen=True, slots=True)
class _Mark:
    """A state of the file after a block, from which writing can continue."""

    written: int  # bytes
    lines: int
    compressor: Any  # zlib's type has no public name
    digest: Any  # nor has hashlib's


class RecordFile:
    """A record file that one thread writes; it owns the descriptor."""

    def __init__(self, fd: int, *, size: int) -> None:
        """``size``: maximum size of the file, bytes."""
        self._fd = fd
        self._size = size
        self._written = 0
        self._lines = 0
        self._compressor = zlib.compressobj(LEVEL, zlib.DEFLATED, GZIP)
        self._digest = blake2b(digest_size=16)
        self._marks: deque[_Mark] = deque([self._mark()], maxlen=2)

    def __repr__(self) -> str:
        return f"RecordFile({self._lines} lines, {self._written} bytes)"

    def has_room_for(self, text: bytes) -> bool:
        """Whether a text and the end mark after it fit into the size limit."""
        return self._written + len(text) + ROOM_OF_END <= self._size

    def write(self, text: bytes) -> None:
        """Write whole lines. After OSError, call ``end`` and write no more."""
        self._put(text, zlib.Z_SYNC_FLUSH)
        self._lines += text.count(b"\n")
        self._marks.append(self._mark())

    def end(self, why: str) -> bool:
        """Write the end mark and close the file; return whether the mark was written."""
        try:
            return any(self._end_at(mark, why) for mark in reversed(self._marks))
        finally:
            os.close(self._fd)

    def _end_at(self, mark: _Mark, why: str) -> bool:
        """Cut the file back to a state and write the end mark there; return whether that worked."""
        with suppress(OSError):
            os.ftruncate(self._fd, mark.written)
            os.lseek(self._fd, mark.written, os.SEEK_SET)
            self._written, self._lines = mark.written, mark.lines
            self._compressor, self._digest = mark.compressor.copy(), mark.digest.copy()
            line = dumps(["end", why, self._lines, self._digest.hexdigest()]) + "\n"
            self._put(line.encode(), zlib.Z_FINISH)
            return True
        return False

    def _put(self, text: bytes, how: int) -> None:
        data = self._compressor.compress(text) + self._compressor.flush(how)
        write_all(self._fd, data)
        self._written += len(data)
        self._digest.update(text)

    def _mark(self) -> _Mark:
        return _Mark(self._written, self._lines, self._compressor.copy(), self._digest.copy())
