"""Writes the decision record: all inputs and outputs of the engine; see ``record_lines``."""

import logging
import platform
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from mav_tasks.basics.errors import RecordError
from mav_tasks.config.settings import Settings
from mav_tasks.engine.inputs import Input, Outgoing
from mav_tasks.recording.backlog import MOST, PAUSE, ROOM_OF_PACKET, Backlog, room_of
from mav_tasks.recording.new_files import new_file
from mav_tasks.recording.record_file import RecordFile
from mav_tasks.recording.record_lines import FORMAT, MAGIC, ROWS, LineWriter, Unwritable, dumps
from mav_tasks.recording.surroundings import restored_to_json
from mav_tasks.recording.writing import WritingThread
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.restored import Restored

log = logging.getLogger("mav_tasks")

SUFFIX = ".decisions.gz"
BLOCK = 1 << 15  # bytes of text per write

CLOSED = "the run is over"
TOO_LONG = "the record has reached its size limit"
TOO_MUCH = "the disk was too slow"

Entry = tuple[float, Input | None] | tuple[float, Sequence[Outgoing], Sequence[Event]]


class Decisions:
    """An observer that writes one record of the run; it ends the record rather than leave gaps."""

    def __init__(
        self,
        folder: Path,
        settings: Settings,
        restored: Restored | None,
        *,
        now: float,
        size: int,
        start: str,
        most_waiting: int = MOST,
    ) -> None:
        """Create the file, named by ``start``; raise RecordError. ``size``: its limit in bytes.

        ``settings``, ``restored`` and ``now`` must be those of the engine.
        """
        try:
            fd, self.path, _ = new_file(folder, start, 0, SUFFIX)
        except OSError as error:
            raise RecordError(f"cannot write records to {folder}: {error.strerror}") from error
        self._file = RecordFile(fd, size=size)
        self._lines = LineWriter()
        self._beginning = self._beginning_of(settings, restored, now)
        self._backlog: Backlog[Entry] = Backlog(most_waiting)
        self._why = ""  # why no more entries are queued; "": they are
        self._has_ended = False
        self._thread = WritingThread(str(self), write=self._write, end=self._finish)

    def __repr__(self) -> str:
        return f"Decisions({self._file}, {self._backlog})"

    def __str__(self) -> str:
        return f"record of decisions {self.path}"

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Queue an input, or the end of the record if the queue is full."""
        if not self._why and not self._backlog.put((now, item), room_of(item)):
            self._why = TOO_MUCH

    def on_output(
        self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float
    ) -> None:
        """Queue the engine's output, or the end of the record if the queue is full."""
        room = ROOM_OF_PACKET * (1 + len(packets) + len(events))
        if not self._why and not self._backlog.put((now, packets, events), room):
            self._why = TOO_MUCH

    def close(self) -> None:
        """Write the waiting entries and the end mark; wait a bounded time for that."""
        self._thread.close()

    def _write(self) -> None:
        why = self._why  # read first: all entries up to then are in the backlog
        self._write_lines(self._beginning)
        self._beginning = iter(())
        self._write_lines(self._noted())
        if why:
            self._end(why)

    def _finish(self) -> None:
        self._end(CLOSED)

    def _noted(self) -> Iterator[str]:
        for entry in self._backlog.taken():
            if len(entry) == 2:
                now, item = entry
                yield self._lines.taken(item, now=now)
            else:
                now, packets, events = entry
                yield self._lines.given(packets, events, now=now)

    def _write_lines(self, lines: Iterator[str]) -> None:
        block: list[str] = []
        length = 0
        why = ""
        try:
            for line in lines:
                block.append(line)
                length += len(line)
                if length > BLOCK:
                    self._write_block(block)
                    block, length = [], 0
                    time.sleep(PAUSE)  # there may be very many restored tasks
        except Unwritable as mistake:
            why = str(mistake)
        if block:
            self._write_block(block)
        if why:
            self._end(why)

    def _write_block(self, block: Sequence[str]) -> None:
        if self._has_ended:
            return
        text = "".join(f"{line}\n" for line in block).encode("ascii")
        if not self._file.has_room_for(text):
            self._end(TOO_LONG)
            return
        try:
            self._file.write(text)
        except OSError as error:
            self._end(f"the disk failed: {error.strerror}")

    def _end(self, why: str) -> None:
        if self._has_ended:
            return
        self._has_ended = True
        self._why = why
        is_marked = self._file.end(why)
        if why != CLOSED or not is_marked:
            log.warning("%s ends%s: %s", self, "" if is_marked else " without an end mark", why)

    def _beginning_of(
        self, settings: Settings, restored: Restored | None, now: float
    ) -> Iterator[str]:
        first = {
            MAGIC: FORMAT,
            "version": project_version(),
            "python": platform.python_version(),
            "machine": f"{platform.system()} {platform.machine()}",
            "now": now,
            "settings": asdict(settings),
            "restored": None if restored is None else restored_to_json(restored),
            "rows": ROWS,
        }
        yield dumps(first)
        for task in () if restored is None else restored.tasks:
            yield self._lines.task(task)


def project_version() -> str:
    try:
        return version("mav-tasks")
    except PackageNotFoundError:
        return "unknown"
