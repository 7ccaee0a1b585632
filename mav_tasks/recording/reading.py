"""Reads a decision record, as far as it goes. The file is untrusted input.

A file that is no record of this version raises RecordError with one clear line. A missing end is no
error: its server crashed, or still writes.
"""

import stat
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import blake2b
from itertools import islice
from json import loads
from math import isfinite
from pathlib import Path
from typing import Any

from mav_tasks.basics.errors import RecordError
from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import Input
from mav_tasks.recording.record_file import GZIP
from mav_tasks.recording.record_lines import EVENTS, FORMAT, MAGIC, ROWS, input_of
from mav_tasks.recording.surroundings import restored_of, settings_of
from mav_tasks.store.codec import Decoder, Unreadable
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored
from mav_tasks.tasks.task import Task

PIECE = 1 << 16  # bytes read at once
GZIP_MAGIC = b"\x1f\x8b"
TASKS_AT_ONCE = 5_000
MOST_OF_A_LINE = 1 << 25  # bytes; our lines are shorter
_EVENTS = Decoder(ROWS, is_exact=True)
NOT_OURS = (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError)


@dataclass(frozen=True, slots=True)
class Entry:
    """One line: ``number`` counts from 1, ``raw`` is its text without the newline."""

    number: int
    raw: bytes
    values: Sequence[Any]

    @property
    def kind(self) -> Any:
        """The line's first item: an input's kind, "deadline" or "out"."""
        return self.values[0]

    @property
    def now(self) -> float:
        """Monotonic seconds of the run."""
        return self.values[1]  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Record:
    """One run, as far as it was recorded. ``why_it_ends`` is None if the end mark is missing."""

    path: Path
    version: str
    python: str
    machine: str
    now: float
    settings: Settings
    restored: Restored | None
    lines: int
    why_it_ends: str | None

    def entries(self) -> Iterator[Entry]:
        """Yield the engine's inputs and outputs, in order."""
        begin = 1 + (0 if self.restored is None else len(self.restored.tasks))
        for number, raw in islice(_numbered(self.path), begin, self.lines):
            yield Entry(number, raw, _entry_values(self.path, number, raw))

    def input_of(self, entry: Entry) -> Input | None:
        """Return the input of an entry, None for a deadline; raise RecordError if it is none."""
        try:
            return input_of(entry.values)
        except NOT_OURS as error:
            raise self._unreadable(entry, error) from error

    def events_of(self, entry: Entry) -> list[Event]:
        """Return the events of an output; raise RecordError if it has none."""
        try:
            _, _, _, _, rows = entry.values
            return [_event_of(*row) for row in rows]
        except (*NOT_OURS, Unreadable) as error:
            raise self._unreadable(entry, error) from error

    def _unreadable(self, entry: Entry, error: Exception) -> RecordError:
        return RecordError(f"{self.path}: line {entry.number} is unreadable: {_words(error)}")


def is_record(path: Path) -> bool:
    """Return whether a file begins as a record does, and not as a telemetry log.

    Raise RecordError if it cannot be read.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise RecordError(f"{path}: not a file")
        with path.open("rb") as file:
            return file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror}") from error


def read(path: Path) -> Record:
    """Read and check a whole record.

    Raise RecordError if the file is no record, is damaged, or is another version's.
    """
    first = _first_line(path)
    lines, why_it_ends = _measure(path)
    try:
        if first["rows"] != {name: list(places) for name, places in ROWS.items()}:
            raise RecordError(
                f"{path}: recorded by version {first['version']}, whose events have another format"
            )
        for name in ("version", "python", "machine"):
            _check_words(first[name])
        if type(first["now"]) not in (int, float) or not isfinite(first["now"]):
            raise ValueError("no time")
        given = first["restored"]
        return Record(
            path=path,
            version=first["version"],
            python=first["python"],
            machine=first["machine"],
            now=first["now"],
            settings=settings_of(first["settings"]),
            restored=None if given is None else restored_of(given, _tasks(path, given["tasks"])),
            lines=lines,
            why_it_ends=why_it_ends,
        )
    except NOT_OURS as error:
        raise RecordError(f"{path}: unreadable header: {_words(error)}") from error


def _measure(path: Path) -> tuple[int, str | None]:
    """Return the number of lines before the end mark, and the mark's reason, None without a mark.

    Raise RecordError if the mark's count or digest does not match the lines before it, or if
    anything comes after it.
    """
    digest = blake2b(digest_size=16)
    lines, why = 0, None
    for number, raw in _numbered(path):
        if why is not None:
            raise RecordError(f"{path}: data after its end")
        if raw.startswith(b'["end",'):
            try:
                _, why, count, given = loads(raw)
                _check_words(why)
            except NOT_OURS as error:
                raise RecordError(f"{path}: line {number} is not a valid end mark") from error
            if (count, given) != (lines, digest.hexdigest()):
                raise RecordError(f"{path}: modified after it was written")
            continue
        digest.update(raw + b"\n")
        lines = number
    return lines, why


def _first_line(path: Path) -> dict[str, Any]:
    _, raw = next(_numbered(path), (0, b""))
    with suppress(*NOT_OURS):
        first = loads(raw)
        if isinstance(first, dict) and MAGIC in first:
            if first[MAGIC] == FORMAT:
                return first
            raise RecordError(f"{path}: its format is {first[MAGIC]}; this version reads {FORMAT}")
    raise RecordError(f"{path}: not a record of decisions")


def _tasks(path: Path, count: int) -> tuple[Task, ...]:
    decoder = Decoder(ROWS, is_exact=True)
    tasks: list[Task] = []
    lines = islice(_numbered(path), 1, 1 + count)
    while rows := [_row(path, number, raw) for number, raw in islice(lines, TASKS_AT_ONCE)]:
        try:
            tasks += decoder.values(Task, rows, offset=0.0)
        except (*NOT_OURS, Unreadable) as error:
            raise RecordError(f"{path}: unreadable tasks: {error}") from error
    if len(tasks) < count:
        raise RecordError(f"{path}: ends before the run began")
    return tuple(tasks)


def _row(path: Path, number: int, raw: bytes) -> list[Any]:
    try:
        kind, row = loads(raw)
        if kind != "task":
            raise ValueError(f"{kind!r}")
    except NOT_OURS as error:
        raise RecordError(f"{path}: line {number} is not a task: {_words(error)}") from error
    return row  # type: ignore[no-any-return]


def _entry_values(path: Path, number: int, raw: bytes) -> Sequence[Any]:
    try:
        kind, now, *rest = loads(raw)
        if type(now) not in (int, float) or not isinstance(kind, str):
            raise ValueError("no time")
    except NOT_OURS as error:
        raise RecordError(f"{path}: line {number} is unreadable: {_words(error)}") from error
    return [kind, now, *rest]


def _numbered(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the complete lines of a file with their numbers; skip an incomplete last line."""
    begun = bytearray()
    number = 0
    for data in _inflated(path):
        end, *lines = data.split(b"\n")
        begun += end
        if len(begun) > MOST_OF_A_LINE:
            raise RecordError(f"{path}: line {number + 1} is too long for a record")
        for following in lines:
            number += 1
            yield number, bytes(begun)
            begun = bytearray(following)


def _inflated(path: Path) -> Iterator[bytes]:
    stream = zlib.decompressobj(GZIP)
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # a record is read more than once
            raise RecordError(f"{path}: not a file")
        with path.open("rb") as file:
            while piece := file.read(PIECE):
                while piece and not stream.eof:
                    yield stream.decompress(piece, PIECE)
                    piece = stream.unconsumed_tail
                if stream.unused_data:
                    raise RecordError(f"{path}: data after its end")
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror}") from error
    except zlib.error as error:
        raise RecordError(f"{path}: not a record of decisions, or damaged: {error}") from error


def _event_of(name: str, *row: Any) -> Event:
    (event,) = _EVENTS.values(EVENTS[name], [list(row)], offset=0.0)
    return event  # type: ignore[no-any-return]


def _check_words(value: Any) -> None:
    """Raise ValueError for a value that is no text, or contains terminal control characters."""
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError("no words")


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if isinstance(error, KeyError) else str(error)
