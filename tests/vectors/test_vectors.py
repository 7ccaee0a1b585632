"""Golden packets of our messages, and of those that we extend, by an encoder that shares nothing.

A struct in the order that MAVLink's guide gives ("Packet Serialization": by size of type,
extensions last as listed), a CRC computed bit by bit, CRC_EXTRA from names and types.
``unit/mavlink/test_codec.py`` has those of the stock dialects.
"""

import struct
from collections.abc import Iterator
from math import nan
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.packet import split_datagram

SIZES = {"uint32_t": 4, "float": 4, "uint16_t": 2, "uint8_t": 1, "char": 1}
FORMATS = {"uint32_t": "I", "float": "f", "uint16_t": "H", "uint8_t": "B"}

MAX = 16777215  # of a task's id
SEQ, SERVER = 200, Address(1, 191)

#: of our messages: number, fields in lines of one type, and extensions
DEFINITIONS = {
    "TASK_STATUS": (
        54000,
        """uint32_t time_boot_ms task_id version nonce after_task_id
        float remaining time_to_start time_to_finish execution_time
        uint16_t command queue_position step step_count
        uint8_t target_system target_component state reason priority progress remaining_unit
        uint8_t submitter_system submitter_component submitter_link
        char text:50""",
        """uint32_t halt_epoch
        char label:24
        uint32_t series
        char repeat:64""",
    ),
    "TASK_QUEUE_STATUS": (
        54001,
        """uint32_t time_boot_ms version running_id next_id capacity counts:14
        uint8_t paused_reason flags""",
        """uint32_t halt_epoch heartbeat_age
        char gateway:40""",
    ),
    "TASK_TIMING": (
        54002,
        """uint32_t time_boot_ms task_id count late
        float rate p50 p99 longest
        uint8_t target_system target_component""",
        "",
    ),
    "PROTOCOL_VERSION": (
        300,
        """uint16_t version min_version max_version
        uint8_t spec_version_hash:8 library_version_hash:8""",
        "",
    ),
    "MISSION_ACK": (
        47,
        "uint8_t target_system target_component type",
        """uint8_t mission_type
        uint32_t opaque_id""",
    ),
}
Field = tuple[str, str, int]  # type, name, array length or 0

STATUS = (
    *(4294967295, MAX, 3, 1, 0, 1.25, nan, nan, 12.5, 54000, 65535, 0, 1, 255, 190, 5, 0, 10),
    *(37, 1, 255, 190, 0, "move 2 m: executing", 0, "", 0, ""),
)
FULL = (
    *(*STATUS[:15], 9, 0, 10, 100, *STATUS[19:23]),
    *("x" * 50, 1 << 24, "y" * 24, 1 << 24, "z" * 64),
)
QUEUE = (1000, 7, 3, 5, 1000, list(range(14)), 35, 0, 12)
OWN: dict[str, tuple[str, tuple[Any, ...]]] = {
    "a task under way": ("TASK_STATUS", STATUS),
    "a text without room for a zero": ("TASK_STATUS", FULL),
    "a stopped queue of an older server": ("TASK_QUEUE_STATUS", (*QUEUE, 0, "")),
    "a stopped queue of a silent rover": ("TASK_QUEUE_STATUS", (*QUEUE, 12_345, "north")),
    "even setpoints": ("TASK_TIMING", (1000, MAX, 1204, 2, 20.0, 0.0625, 0.125, 0.15625, 255, 190)),
    "versions": ("PROTOCOL_VERSION", (200, 100, 200, [1, 2, 3, 4, 5, 6, 7, 8], [0] * 8)),
    "an upload's id": ("MISSION_ACK", (245, 190, 0, 0, MAX)),
}


def packet_of(kind: str, given: tuple[Any, ...]) -> bytes:
    """Return a packet, made by hand."""
    number, base, extensions = DEFINITIONS[kind]
    fields = [*_fields(base), *_fields(extensions)]
    values = {name: value for (_, name, _), value in zip(fields, given, strict=True)}
    in_order = sorted(_fields(base), key=lambda field: -SIZES[field[0]])  # stable
    packed = [_packed(field, values[field[1]]) for field in [*in_order, *_fields(extensions)]]
    payload = b"".join(packed).rstrip(b"\0") or packed[0][:1]
    body = bytes([len(payload), 0, 0, SEQ, *SERVER]) + number.to_bytes(3, "little")
    checksum = crc(body + payload + bytes([crc_extra(kind, in_order)]))
    return b"\xfd" + body + payload + checksum.to_bytes(2, "little")


def _fields(text: str) -> Iterator[Field]:
    for line in text.splitlines():
        kind, *names = line.split()
        for each in names:
            name, _, length = each.partition(":")
            yield kind, name, int(length or 0)


def _packed(field: Field, value: Any) -> bytes:
    kind, _, length = field
    if kind == "char":
        return struct.pack(f"<{length}s", value.encode())
    if length:
        return struct.pack(f"<{length}{FORMATS[kind]}", *value)
    return struct.pack(f"<{FORMATS[kind]}", float(value) if kind == "float" else value)


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX, a bit at a time."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0x8408 if value & 1 else 0)
    return value


def crc_extra(kind: str, in_order: list[Field]) -> int:
    """The byte that tells definitions apart. MAVLink guide, "CRC_EXTRA Calculation"."""
    text = f"{kind} ".encode()
    for field_type, name, length in in_order:
        text += f"{field_type} {name} ".encode() + (bytes([length]) if length else b"")
    value = crc(text)
    return value & 0xFF ^ value >> 8


def test_golden_packets_are_decoded_and_encoded() -> None:
    kinds: dict[str, Any] = {each.msgname: each for each in m.ALL.values()}
    for name, (kind, given) in OWN.items():
        raw = packet_of(kind, given)
        (packet,) = split_datagram(raw)
        message = Decoder().decode(packet)
        assert message is not None, name
        found = message.get_type(), [getattr(message, each) for each in message.fieldnames]
        assert repr(found) == repr((kind, list(given))), name  # as text: NaN is equal to NaN
        values = [each.encode() if isinstance(each, str) else each for each in given]
        for made in (message, kinds[kind](*values)):
            assert Packer().pack(made, SERVER, seq=SEQ) == raw, name
