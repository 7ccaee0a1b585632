"""Recordings as one stream of what happened, in the order of its times: for exports and the map.

A telemetry log has the packets, received and sent. A record of decisions has the events of the
tasks, and the packets that were received, with their links; of what was sent it has a digest only.
So its packets are taken only if there is no telemetry log, in which they are, too.
"""

import heapq
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from mav_tasks.basics.errors import UsageError
from mav_tasks.engine import inputs
from mav_tasks.engine.inputs import Input, LinkSide, Packets
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.recording.decisions import SUFFIX
from mav_tasks.recording.reading import Record, is_record, read
from mav_tasks.recording.tlog_content import TlogContent
from mav_tasks.recording.tlog_reading import STAMP, pieces
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.task import Task

LAST_TIME = (1 << 64) - 1  # ns; MCAP has no later one


class Way(NamedTuple):
    """Where packets came from: file, link and its side; "" where that is not known."""

    file: str
    link: str = ""
    side: str = ""


class Heard(NamedTuple):
    """A packet, or what lies between two of them; ``data`` is as in a telemetry log."""

    time: int  # ns since 1970
    data: bytes
    packet: Packet | None
    way: Way


class Happened(NamedTuple):
    """An event of the server."""

    time: int
    event: Event


class Restored(NamedTuple):
    """The tasks with which a run began."""

    time: int
    tasks: Sequence[Task]


Item = Heard | Happened | Restored


def items_of(paths: Sequence[Path]) -> Iterator[Item]:
    """Yield what the recordings have; raise RecordError if one is unreadable."""
    for index, path in enumerate(paths):
        if path.name in [other.name for other in paths[:index]]:
            raise UsageError(f"two recordings are named {path.name}: rename one of them")
    logs = [path for path in paths if not is_record(path)]
    records = [read(path) for path in paths if path not in logs]
    streams: list[Iterator[Item]] = [_of_log(path) for path in logs]
    streams += [_of_record(record, with_packets=not logs) for record in records]
    # each of them is in order, except where somebody set the clock back
    return heapq.merge(*streams, key=itemgetter(0))


def _of_log(path: Path) -> Iterator[Heard]:
    way = Way(_name(path))
    for data, stamp, packet in pieces(path):
        yield Heard(min(stamp * 1000, LAST_TIME), data, packet, way)


def _of_record(record: Record, *, with_packets: bool) -> Iterator[Item]:
    content = TlogContent(component_id=record.settings.identity.component_id)
    offset = _first_offset(record)
    sides: dict[str, LinkSide] = {}
    name = _name(record.path).removesuffix(SUFFIX) + ".tlog"
    begin = _ns(record.now + offset)
    if record.restored is not None:
        yield Restored(begin, record.restored.tasks)
    for entry in record.entries():
        time = _ns(entry.now + offset)
        if entry.kind == "out":
            for event in record.events_of(entry):
                yield Happened(time, event)
            continue
        item = record.input_of(entry)
        match item:
            case inputs.WallClock():
                offset = item.offset
            case inputs.LinkChanged():
                sides[item.link] = item.side
        if with_packets and item is not None:
            for link, stamped in _stamped(content, item, entry.now):
                side = sides[link].name.lower() if link in sides else ""
                way = Way(name, link, side)
                (packet,) = split_datagram(stamped[STAMP:])
                yield Heard(int.from_bytes(stamped[:STAMP]) * 1000, stamped, packet, way)


def _stamped(content: TlogContent, item: Input, now: float) -> Iterator[tuple[str, bytes]]:
    """Yield the link and the log's form of each packet of an input; other inputs have none."""
    if isinstance(item, inputs.AtOnce):
        for each in item.packets:
            yield from _stamped(content, each, now)
    else:
        link = item.link if isinstance(item, Packets) else ""
        for stamped in content.of_input(item, now=now):
            yield link, stamped


def _first_offset(record: Record) -> float:
    """Return UTC minus monotonic seconds at the start; 0 if the record never says it."""
    for entry in record.entries():
        if entry.kind == "wall clock":
            item = record.input_of(entry)
            assert isinstance(item, inputs.WallClock)
            return item.offset
    return 0.0


def _name(path: Path) -> str:
    return path.name.encode(errors="replace").decode()


def _ns(utc: float) -> int:
    return min(max(0, round(utc * 1e6)) * 1000, LAST_TIME)
