"""Makes one MCAP file of telemetry logs and records of decisions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mav_tasks.mavlink.codec import Decoder
from mav_tasks.recording.decisions import project_version
from mav_tasks.recording.mcap_export.task_views import TaskViews
from mav_tasks.recording.mcap_export.views import Views
from mav_tasks.recording.mcap_export.writing import McapWriter
from mav_tasks.recording.sources import Happened, Heard, Restored, items_of


@dataclass(slots=True)
class Counts:
    """What was exported."""

    packets: int = 0
    events: int = 0
    raw_only: int = 0  # packets of unknown ids or with a wrong CRC, or beyond MOST_CHANNELS
    other_bytes: int = 0  # between the packets


class _Export:
    def __init__(self, file: BinaryIO) -> None:
        self.counts = Counts()
        self._writer = McapWriter(file, version=project_version())
        self._decoder = Decoder()
        self._views = Views()
        self._tasks = TaskViews()
        self._time = 0

    def add(self, item: Heard | Happened | Restored) -> None:
        self._time = item.time
        match item:
            case Heard():
                self._hear(item)
            case Happened(event=event):
                self.counts.events += 1
                for seen in self._tasks.of(event, time=item.time):
                    self._writer.add(seen)
            case _:
                for seen in self._tasks.restored(item.tasks, time=item.time):
                    self._writer.add(seen)

    def finish(self) -> Counts:
        for seen in self._views.rest(time=self._time):
            self._writer.add(seen)
        self._writer.finish()
        return self.counts

    def _hear(self, heard: Heard) -> None:
        self._writer.add_raw(heard)
        packet = heard.packet
        if packet is None:
            self.counts.other_bytes += len(heard.data)
            return
        self.counts.packets += 1
        message = self._decoder.decode(packet)
        if message is None or not self._writer.add_message(message, packet, heard):
            self.counts.raw_only += 1
            return
        for seen in self._views.of(message, packet.source, time=heard.time):
            self._writer.add(seen)


def export(records: Sequence[Path], file: BinaryIO) -> Counts:
    """Write the recordings into an open file; raise RecordError if one is unreadable."""
    running = _Export(file)
    for item in items_of(records):
        running.add(item)
    return running.finish()
