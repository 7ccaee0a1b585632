"""Writes telemetry logs (tlog) for ground stations: each packet after its time, 8 bytes big-endian.

Packets that cannot be written are dropped and counted; the server never waits for a log.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from mav_tasks.engine import inputs
from mav_tasks.engine.inputs import Input, Outgoing, Packets
from mav_tasks.recording.backlog import MOST, ROOM_OF_PACKET, SMALL, Backlog, room_of
from mav_tasks.recording.losses import Losses
from mav_tasks.recording.new_files import write_all
from mav_tasks.recording.tlog_content import TlogContent
from mav_tasks.recording.tlog_files import TlogFiles
from mav_tasks.recording.writing import WritingThread
from mav_tasks.tasks.events import Event

RETRY = 1.0  # s after a disk failure, until the next attempt
AT_ONCE = 1_000  # packets collected for one write

Entry = tuple[float, Input | Sequence[Outgoing]]


class Tlog:
    """An observer that writes telemetry logs into a folder."""

    def __init__(
        self,
        folder: Path,
        *,
        size: int,
        count: int,
        component_id: int,
        start: str,
        most_waiting: int = MOST,
        write: Callable[[int, bytes], None] = write_all,
    ) -> None:
        """``size``: of one file, bytes. ``count``: of files. ``component_id``: the server's.

        ``start`` names the files.
        """
        self._name = f"telemetry log in {folder}"
        self._backlog: Backlog[Entry] = Backlog(most_waiting)
        self._content = TlogContent(component_id=component_id)
        self._files = TlogFiles(folder, size=size, count=count, start=start, write=write)
        self._too_many = Losses(self._name)
        self._unwritten = Losses(self._name)
        self._retry_at = 0.0  # monotonic s
        self._thread = WritingThread(self._name, write=self._write, end=self._end)

    def __repr__(self) -> str:
        return f"Tlog({self._files}, {self._backlog})"

    def __str__(self) -> str:
        return self._name

    @property
    def lost(self) -> int:
        """Number of packets that were not written, since the start."""
        return self._too_many.count + self._unwritten.count

    def on_input(self, item: Input | None, *, now: float) -> None:
        """Queue received packets, and changes of links, peers and the wall clock."""
        if isinstance(item, Packets):
            if not self._backlog.put((now, item), room_of(item)):
                self._too_many.lose(len(item.datagrams), "the disk is too slow")
        elif isinstance(item, inputs.AtOnce):
            for each in item.packets:
                self.on_input(each, now=now)
        elif isinstance(item, inputs.WallClock | inputs.LinkChanged | inputs.PeerChanged):
            self._backlog.put((now, item), SMALL)

    def on_output(
        self,
        packets: Sequence[Outgoing],
        events: Sequence[Event],  # noqa: ARG002
        *,
        now: float,
    ) -> None:
        """Queue sent packets; a telemetry log has no events."""
        if packets and not self._backlog.put((now, packets), ROOM_OF_PACKET * len(packets)):
            self._too_many.lose(len(packets), "the disk is too slow")

    def close(self) -> None:
        """Write the waiting packets; wait a bounded time for that."""
        self._thread.close()

    def _write(self) -> None:
        packets: list[bytes] = []
        is_well = True
        for now, item in self._backlog.taken():
            if isinstance(item, Sequence):
                packets += self._content.of_output(item, now=now)
            else:
                packets += self._content.of_input(item, now=now)
            if len(packets) >= AT_ONCE:
                is_well = self._keep(packets)
                packets = []
        if packets:
            is_well = self._keep(packets)
        if is_well:
            self._too_many.over()

    def _keep(self, packets: Sequence[bytes]) -> bool:
        """Write packets, or drop and count them; return whether all were written."""
        why = "waiting after a disk error"
        kept = self._files.kept
        if time.monotonic() >= self._retry_at:
            try:
                self._files.write(packets)
            except OSError as error:
                self._retry_at = time.monotonic() + RETRY
                why = str(error.strerror or error)
            else:
                self._unwritten.over()
                return True
        self._unwritten.lose(len(packets) - (self._files.kept - kept), why)
        return False

    def _end(self) -> None:
        self._unwritten.end()
        self._too_many.end()
        self._files.close()
