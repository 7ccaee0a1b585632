"""Writes an MCAP file as a stream: channels are made when their first message comes.

Chunks are not compressed: the compressors that MCAP allows, zstd and lz4, are compiled packages. So
that the file is read anywhere, and is the same for the same recordings, none is used.
"""

import json
from typing import Any, BinaryIO

from mcap.writer import CompressionType, Writer

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.messages import Message
from mav_tasks.mavlink.packet import Packet
from mav_tasks.recording.mcap_export.convention import (
    CONVENTION,
    RAW,
    RAW_ENCODING,
    RAW_SCHEMA,
    VERSION,
    message_topic,
)
from mav_tasks.recording.mcap_export.message_json import MessageJson
from mav_tasks.recording.mcap_export.schemas import Schema, message_schema
from mav_tasks.recording.mcap_export.views import Seen
from mav_tasks.recording.sources import Heard, Way

#: MCAP numbers them with 16 bits; a log of noise could have more
MOST_CHANNELS = 20_000

_encode = json.JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False).encode


class McapWriter:
    """Writes messages into an open file; ``finish`` completes it."""

    def __init__(self, file: BinaryIO, *, version: str) -> None:
        """``version``: of this program."""
        # Any: most of its methods have no annotation
        self._writer: Any = Writer(file, compression=CompressionType.NONE, enable_data_crcs=True)
        self._writer.start(library=f"mav-tasks {version}")
        self._writer.add_metadata(CONVENTION, {"convention": VERSION, "version": version})
        self._schemas: dict[str, int] = {}
        self._channels: dict[Any, int | None] = {}
        self._counts: dict[str, int] = {}
        self._kinds: dict[int, MessageJson] = {}

    def __repr__(self) -> str:
        return f"McapWriter({len(self._channels)} channels)"

    def add_raw(self, heard: Heard) -> None:
        """Add bytes of a telemetry log. A number in ``sequence`` keeps their order."""
        key = (RAW, heard.way.file)
        channel = self._channels.get(key)
        if channel is None:
            metadata = {"file": heard.way.file}
            channel = self._writer.register_channel(
                RAW, RAW_ENCODING, self._schema(RAW_SCHEMA, "", b""), metadata
            )
            self._channels[key] = channel
        count = self._counts.get(heard.way.file, 0)
        self._counts[heard.way.file] = count + 1
        sequence = count & 0xFFFF_FFFF
        self._writer.add_message(channel, heard.time, heard.data, heard.time, sequence)

    def add_message(self, message: Message, packet: Packet, heard: Heard) -> bool:
        """Add the message of a packet; return False if there are too many channels for it."""
        key = (packet.source, packet.message_id, heard.way.link)
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = self._channel_of(packet, heard.way)
            if channel is None:
                return False
        data = self._kinds[packet.message_id].encode(message)
        self._writer.add_message(channel, heard.time, data, heard.time, packet.seq)
        return True

    def add(self, seen: Seen) -> None:
        """Add a value."""
        channel = self._channels.get(seen.topic)
        if channel is None:
            schema = self._json_schema(seen.schema)
            channel = self._writer.register_channel(seen.topic, "json", schema)
            self._channels[seen.topic] = channel
        data = _encode(seen.values).encode()
        self._writer.add_message(channel, seen.time, data, seen.time)

    def finish(self) -> None:
        """Write the index."""
        self._writer.finish()

    def _channel_of(self, packet: Packet, way: Way) -> int | None:
        if len(self._channels) >= MOST_CHANNELS:
            return None
        kind = m.ALL[packet.message_id]
        self._kinds.setdefault(packet.message_id, MessageJson(kind))
        topic = message_topic(packet.source, kind.msgname)
        schema = self._json_schema(message_schema(kind))
        known = {"link": way.link, "side": way.side} if way.link else {}
        number: int = self._writer.register_channel(topic, "json", schema, known)
        return number

    def _json_schema(self, schema: Schema) -> int:
        return self._schema(schema.name, "jsonschema", schema.data)

    def _schema(self, name: str, encoding: str, data: bytes) -> int:
        number = self._schemas.get(name)
        if number is None:
            number = self._schemas[name] = self._writer.register_schema(name, encoding, data)
        return number
