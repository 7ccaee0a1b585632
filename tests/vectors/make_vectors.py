"""Makes ``golden.json``: packets by encoders that share nothing with ours.

Messages of MAVLink's common set are packed by pymavlink's stock dialect. Those of our own dialect,
and those that we extend, by hand: a struct in the order that MAVLink's guide gives ("Packet
Serialization": by size of type, extensions last as listed), a CRC computed bit by bit, CRC_EXTRA
from names and types. Run ``python -m tests.vectors.make_vectors`` after a change of the dialect.
"""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import common

GOLDEN = Path(__file__).with_name("golden.json")
SIZES = {"uint32_t": 4, "float": 4, "uint16_t": 2, "uint8_t": 1, "char": 1}
FORMATS = {"uint32_t": "I", "float": "f", "uint16_t": "H", "uint8_t": "B"}

SECRET = bytes(range(7, 39))
LINK_IDS = (0, 1, 255)
TIMESTAMPS = (1, 37_000_000_000_000, (1 << 48) - 2, 0xFF00)
MAX = 16777215  # of a task's id

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

STOCK = {
    "heartbeat of a rover": common.MAVLink_heartbeat_message(10, 3, 209, 15, 4, 3),
    "TASK_MOVE as COMMAND_LONG": common.MAVLink_command_long_message(
        *(1, 191, 54000, 0, -2.5, 0.5, 0.0, float(MAX), 0.0, 0.0, 8.0)
    ),
    "TASK_ROTATE as COMMAND_INT": common.MAVLink_command_int_message(
        *(1, 1, 8, 54001, 0, 0, 90.0, 0.0, 0.0, 77.0, -7, 2147483647, 5.0)
    ),
    "acknowledgement with a task's id": common.MAVLink_command_ack_message(
        *(54000, 0, 0, MAX, 255, 190)
    ),
    "velocity setpoint with yaw rate": common.MAVLink_set_position_target_local_ned_message(
        *(0, 1, 1, 8, 0x05C7, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.25)
    ),
    "position and velocity": common.MAVLink_local_position_ned_message(
        *(123456, 1.5, -2.5, 0.125, 0.5, -0.25, 0.0)
    ),
    "last chunk of a long text": common.MAVLink_statustext_message(4, b"no such task", 65535, 2),
    "all zero but the checksum": common.MAVLink_system_time_message(0, 0),
}
STATUS = (
    *(4294967295, MAX, 3, 1, 0, 1.25, "nan", "nan", 12.5, 54000, 65535, 0, 1, 255, 190, 5, 0, 10),
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


def golden() -> list[dict[str, Any]]:
    """The whole table."""
    vectors = []
    for number, (name, message) in enumerate(STOCK.items()):
        mav = common.MAVLink(None, srcSystem=1 + number, srcComponent=191)
        mav.seq = 250 + number & 0xFF
        values = {field: getattr(message, field) for field in message.fieldnames}
        if isinstance(message, common.MAVLink_statustext_message):
            values["text"] = values["text"].rstrip("\0")
        vector = _vector(name, message.msgname, mav.seq, 1 + number, values, message.pack(mav))
        vector["v1"] = message.pack(mav, force_mavlink1=True).hex()
        vector["signed"] = _signed(mav, message, number)
        vectors.append(vector)
    return vectors + [_hand_made(name, kind, values) for name, (kind, values) in OWN.items()]


def _signed(mav: Any, message: Any, number: int) -> str:
    """Return it with pymavlink's signature; as the guide's, the times of some need six bytes."""
    mav.signing.secret_key = SECRET
    mav.signing.sign_outgoing = True
    mav.signing.link_id = LINK_IDS[number % len(LINK_IDS)]
    mav.signing.timestamp = TIMESTAMPS[number % len(TIMESTAMPS)]
    return str(message.pack(mav).hex())


def _fields(text: str) -> Iterator[Field]:
    for line in text.splitlines():
        kind, *names = line.split()
        for each in names:
            name, _, length = each.partition(":")
            yield kind, name, int(length or 0)


def _hand_made(name: str, kind: str, given: tuple[Any, ...]) -> dict[str, Any]:
    number, base, extensions = DEFINITIONS[kind]
    fields = [*_fields(base), *_fields(extensions)]
    values = {field[1]: value for field, value in zip(fields, given, strict=True)}
    in_order = sorted(_fields(base), key=lambda field: -SIZES[field[0]])  # stable
    packed = [_packed(field, values[field[1]]) for field in [*in_order, *_fields(extensions)]]
    payload = b"".join(packed).rstrip(b"\0") or packed[0][:1]
    seq, system, component = 200, 1, 191
    body = bytes([len(payload), 0, 0, seq, system, component]) + number.to_bytes(3, "little")
    checksum = crc(body + payload + bytes([crc_extra(kind, in_order)]))
    packet = b"\xfd" + body + payload + checksum.to_bytes(2, "little")
    return _vector(name, kind, seq, system, values, packet)


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


def _vector(
    name: str, kind: str, seq: int, system: int, fields: dict[str, Any], packet: bytes
) -> dict[str, Any]:
    return {
        "name": name,
        "message": kind,
        "seq": seq,
        "system_id": system,
        "component_id": 191,
        "fields": fields,
        "packet": packet.hex(),
    }


def text_of(vectors: list[dict[str, Any]]) -> str:
    """The file's content."""
    return json.dumps(vectors, indent=1) + "\n"


if __name__ == "__main__":
    GOLDEN.write_text(text_of(golden()), encoding="utf-8")
