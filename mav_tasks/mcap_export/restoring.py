"""Restores the telemetry logs of an MCAP file, byte by byte. The file is untrusted input.

The file may have been copied, filtered or compressed by other programs, as long as the raw channel
is complete and in its order: each log's length and digest are checked.
"""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap.exceptions import EndOfFile, InvalidMagic, McapError, UnsupportedCompressionError
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader

from mav_tasks.errors import RecordError
from mav_tasks.mcap_export.convention import (
    CONVENTION,
    RAW,
    RAW_ENCODING,
    TLOG,
    VERSION,
)
from mav_tasks.mcap_export.log_facts import LogFacts

MOST_OF_A_RECORD = 1 << 30  # bytes


class Log(NamedTuple):
    """A restored telemetry log."""

    name: str
    size: int  # bytes


def restore(path: Path, opened: Callable[[str], BinaryIO]) -> list[Log]:
    """Write each telemetry log of an MCAP file to what ``opened`` returns for its name.

    Raise RecordError if the file is not ours, is damaged, or was changed.
    """
    files: dict[str, BinaryIO] = {}
    logs: dict[str, LogFacts] = {}
    names: dict[int, str] = {}
    recorded: dict[str, dict[str, str]] = {}
    for record in _records(path):
        match record:
            case Metadata(name=name, metadata=values) if name == TLOG:
                recorded[values.get("file", "")] = values
            case Channel(topic=topic, message_encoding=encoding) if topic == RAW:
                if encoding != RAW_ENCODING:
                    raise RecordError(f"{path}: {RAW} has the encoding {encoding!r}")
                names[record.id] = record.metadata.get("file", "")
            case Message() if record.channel_id in names:
                name = names[record.channel_id]
                if name not in logs:
                    files[name], logs[name] = opened(name), LogFacts(name)
                files[name].write(record.data)
                logs[name].add(record.data)
    if not logs:
        raise RecordError(f"{path}: has no telemetry log")
    for name, log in logs.items():
        if log.metadata() != recorded.get(name):
            raise RecordError(f"{path}: {name!r} is incomplete, or not in its order")
    return [Log(name, log.size) for name, log in logs.items()]


def _records(path: Path) -> Iterator[Any]:
    """Yield the records of a file after the one that names our convention."""
    is_ours = is_mcap = False
    try:
        with path.open("rb") as file:
            whole: Any = _Bounded(file, path.stat().st_size)  # no BytesIO, as the package asks for
            reader = StreamReader(whole, validate_crcs=True, record_size_limit=MOST_OF_A_RECORD)
            for record in reader.records:
                is_mcap = True
                if isinstance(record, Metadata) and record.name == CONVENTION:
                    _check_version(path, record.metadata.get("convention", ""))
                    is_ours = True
                elif isinstance(record, Message) and not is_ours:
                    raise RecordError(f"{path}: an MCAP file, but not made by mav-tasks export")
                yield record
            if not is_ours:
                raise RecordError(f"{path}: an MCAP file, but not made by mav-tasks export")
    except OSError as error:
        raise RecordError(f"{path}: {error.strerror}") from error
    except UnsupportedCompressionError as error:
        package = str(error).rpartition(" ")[2]
        raise RecordError(f"{path}: compressed with {package}: pip install {package}") from error
    except (InvalidMagic, EndOfFile) as error:
        what = "its end is missing" if is_mcap else "not an MCAP file"
        raise RecordError(f"{path}: {what}") from error
    except (McapError, ValueError, struct.error, MemoryError) as error:
        raise RecordError(f"{path}: damaged: {error}") from error


def _check_version(path: Path, version: str) -> None:
    if version != VERSION:
        words = f"its convention is {version!r}; this version reads {VERSION!r}"
        raise RecordError(f"{path}: {words}")


class _Bounded:
    """A file that refuses to read beyond its end, whatever length a damaged record claims.

    The mcap package takes a short read for a whole one.
    """

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._left = size

    def read(self, length: int) -> bytes:
        """Return so many bytes; raise EndOfFile if there are fewer."""
        if length > self._left:
            raise EndOfFile
        data = self._file.read(length)
        if len(data) < length:
            raise EndOfFile
        self._left -= length
        return data
