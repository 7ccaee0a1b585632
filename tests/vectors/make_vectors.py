"""Makes ``golden.json``: packets by encoders that share nothing with ours.

Messages of MAVLink's common set are packed by pymavlink's stock dialect. Those of our own dialect,
and those that we extend, by hand: a struct in the order that MAVLink's guide gives ("Packet
Serialization": by size of type, extensions last as listed), a CRC computed bit by bit, CRC_EXTRA
from names and types. Run ``python -m tests.vectors.make_vectors`` after a change of the dialect.
"""

import json
import struct
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import common

GOLDEN = Path(__file__).with_name("golden.json")
SIZES = {"uint32_t": 4, "float": 4, "uint16_t": 2, "uint8_t": 1, "char": 1}
FORMATS = {"uint32_t": "I", "float": "f", "uint16_t": "H", "uint8_t": "B"}

SECRET = bytes(range(7, 39))
LINK_IDS = (0, 1, 255)
TIMESTAMPS = (1, 37_000_000_000_000, (1 << 48) - 2, 0xFF00)

Field = tuple[str, str, int]  # type, name, array length or 0

TASK_STATUS: list[Field] = [
    *[
        ("uint32_t", name, 0)
        for name in ("time_boot_ms", "task_id", "version", "nonce", "after_task_id")
    ],
    *[
        ("float", name, 0)
        for name in ("remaining", "time_to_start", "time_to_finish", "execution_time")
    ],
    *[("uint16_t", name, 0) for name in ("command", "queue_position", "step", "step_count")],
    *[
        ("uint8_t", name, 0)
        for name in (
            "target_system",
            "target_component",
            "state",
            "reason",
            "priority",
            "progress",
            "remaining_unit",
            "submitter_system",
            "submitter_component",
            "submitter_link",
        )
    ],
    ("char", "text", 50),
]
HALT_EPOCH: list[Field] = [("uint32_t", "halt_epoch", 0)]
TASK_QUEUE_STATUS: list[Field] = [
    *[
        ("uint32_t", name, 0)
        for name in ("time_boot_ms", "version", "running_id", "next_id", "capacity")
    ],
    ("uint32_t", "counts", 14),
    ("uint8_t", "paused_reason", 0),
    ("uint8_t", "flags", 0),
]
STATUS_EXTENSION: list[Field] = [
    *HALT_EPOCH,
    ("char", "label", 24),
    ("uint32_t", "series", 0),
    ("char", "repeat", 64),
]
QUEUE_EXTENSION: list[Field] = [
    *HALT_EPOCH,
    ("uint32_t", "heartbeat_age", 0),
    ("char", "gateway", 40),
]
TASK_TIMING: list[Field] = [
    *[("uint32_t", name, 0) for name in ("time_boot_ms", "task_id", "count", "late")],
    *[("float", name, 0) for name in ("rate", "p50", "p99", "longest")],
    *[("uint8_t", name, 0) for name in ("target_system", "target_component")],
]
PROTOCOL_VERSION: list[Field] = [
    ("uint16_t", "version", 0),
    ("uint16_t", "min_version", 0),
    ("uint16_t", "max_version", 0),
    ("uint8_t", "spec_version_hash", 8),
    ("uint8_t", "library_version_hash", 8),
]
MISSION_ACK: list[Field] = [
    ("uint8_t", "target_system", 0),
    ("uint8_t", "target_component", 0),
    ("uint8_t", "type", 0),
]
MISSION_ACK_EXTENSIONS: list[Field] = [("uint8_t", "mission_type", 0), ("uint32_t", "opaque_id", 0)]

#: name, class of the stock dialect, values
STOCK: list[tuple[str, Any, dict[str, Any]]] = [
    (
        "heartbeat of a rover",
        common.MAVLink_heartbeat_message,
        {
            "type": 10,
            "autopilot": 3,
            "base_mode": 209,
            "custom_mode": 15,
            "system_status": 4,
            "mavlink_version": 3,
        },
    ),
    (
        "TASK_MOVE as COMMAND_LONG",
        common.MAVLink_command_long_message,
        {
            "target_system": 1,
            "target_component": 191,
            "command": 54000,
            "confirmation": 0,
            "param1": -2.5,
            "param2": 0.5,
            "param3": 0.0,
            "param4": 16777215.0,
            "param5": 0.0,
            "param6": 0.0,
            "param7": 8.0,
        },
    ),
    (
        "TASK_ROTATE as COMMAND_INT",
        common.MAVLink_command_int_message,
        {
            "target_system": 1,
            "target_component": 1,
            "frame": 8,
            "command": 54001,
            "current": 0,
            "autocontinue": 0,
            "param1": 90.0,
            "param2": 0.0,
            "param3": 0.0,
            "param4": 77.0,
            "x": -7,
            "y": 2147483647,
            "z": 5.0,
        },
    ),
    (
        "acknowledgement with a task's id",
        common.MAVLink_command_ack_message,
        {
            "command": 54000,
            "result": 0,
            "progress": 0,
            "result_param2": 16777215,
            "target_system": 255,
            "target_component": 190,
        },
    ),
    (
        "velocity setpoint with yaw rate",
        common.MAVLink_set_position_target_local_ned_message,
        {
            "time_boot_ms": 0,
            "target_system": 1,
            "target_component": 1,
            "coordinate_frame": 8,
            "type_mask": 0x05C7,
            "x": 0.0,
            "y": 0.0,
            "z": 0.0,
            "vx": 0.5,
            "vy": 0.0,
            "vz": 0.0,
            "afx": 0.0,
            "afy": 0.0,
            "afz": 0.0,
            "yaw": 0.0,
            "yaw_rate": -0.25,
        },
    ),
    (
        "position and velocity",
        common.MAVLink_local_position_ned_message,
        {
            "time_boot_ms": 123456,
            "x": 1.5,
            "y": -2.5,
            "z": 0.125,
            "vx": 0.5,
            "vy": -0.25,
            "vz": 0.0,
        },
    ),
    (
        "last chunk of a long text",
        common.MAVLink_statustext_message,
        {"severity": 4, "text": "no such task", "id": 65535, "chunk_seq": 2},
    ),
    (
        "all zero but the checksum",
        common.MAVLink_system_time_message,
        {"time_unix_usec": 0, "time_boot_ms": 0},
    ),
]


def golden() -> list[dict[str, Any]]:
    """The whole table."""
    vectors = []
    for number, (name, kind, values) in enumerate(STOCK):
        mav = common.MAVLink(None, srcSystem=1 + number, srcComponent=191)
        mav.seq = 250 + number & 0xFF
        arguments = {k: v.encode() if isinstance(v, str) else v for k, v in values.items()}
        message = kind(**arguments)
        vector = _vector(name, kind.msgname, mav.seq, 1 + number, values, message.pack(mav))
        vector["v1"] = message.pack(mav, force_mavlink1=True).hex()
        vector["signed"] = _signed(mav, message, number)
        vectors.append(vector)
    vectors += _by_hand()
    return vectors


def _signed(mav: Any, message: Any, number: int) -> str:
    """Return it with pymavlink's signature; as the guide's, the times of some need six bytes."""
    mav.signing.secret_key = SECRET
    mav.signing.sign_outgoing = True
    mav.signing.link_id = LINK_IDS[number % len(LINK_IDS)]
    mav.signing.timestamp = TIMESTAMPS[number % len(TIMESTAMPS)]
    return str(message.pack(mav).hex())


def _by_hand() -> list[dict[str, Any]]:
    status = {
        "time_boot_ms": 4294967295,
        "task_id": 16777215,
        "version": 3,
        "nonce": 1,
        "after_task_id": 0,
        "remaining": 1.25,
        "time_to_start": "nan",
        "time_to_finish": "nan",
        "execution_time": 12.5,
        "command": 54000,
        "queue_position": 65535,
        "step": 0,
        "step_count": 1,
        "target_system": 255,
        "target_component": 190,
        "state": 5,
        "reason": 0,
        "priority": 10,
        "progress": 37,
        "remaining_unit": 1,
        "submitter_system": 255,
        "submitter_component": 190,
        "submitter_link": 0,
        "text": "move 2 m: executing",
        "halt_epoch": 0,
        "label": "",
        "series": 0,
        "repeat": "",
    }
    full = status | {"text": "x" * 50, "state": 9, "progress": 100, "halt_epoch": 1 << 24}
    full |= {"label": "y" * 24, "series": 1 << 24, "repeat": "z" * 64}
    queue = {
        "time_boot_ms": 1000,
        "version": 7,
        "running_id": 3,
        "next_id": 5,
        "capacity": 1000,
        "counts": list(range(14)),
        "paused_reason": 35,
        "flags": 0,
        "halt_epoch": 12,
        "heartbeat_age": 0,
        "gateway": "",
    }
    silent = queue | {"heartbeat_age": 12_345, "gateway": "north"}
    timing = {
        "time_boot_ms": 1000,
        "task_id": 16777215,
        "count": 1204,
        "late": 2,
        "rate": 20.0,
        "p50": 0.0625,
        "p99": 0.125,
        "longest": 0.15625,
        "target_system": 255,
        "target_component": 190,
    }
    version = {
        "version": 200,
        "min_version": 100,
        "max_version": 200,
        "spec_version_hash": [1, 2, 3, 4, 5, 6, 7, 8],
        "library_version_hash": [0] * 8,
    }
    plan = {
        "target_system": 245,
        "target_component": 190,
        "type": 0,
        "mission_type": 0,
        "opaque_id": 16777215,
    }
    extended = MISSION_ACK_EXTENSIONS
    text = "a text without room for a zero"
    return [
        _hand_made("a task under way", "TASK_STATUS", 54000, TASK_STATUS, STATUS_EXTENSION, status),
        _hand_made(text, "TASK_STATUS", 54000, TASK_STATUS, STATUS_EXTENSION, full),
        *(
            _hand_made(name, "TASK_QUEUE_STATUS", 54001, TASK_QUEUE_STATUS, QUEUE_EXTENSION, fields)
            for name, fields in (
                ("a stopped queue of an older server", queue),
                ("a stopped queue of a silent rover", silent),
            )
        ),
        _hand_made("even setpoints", "TASK_TIMING", 54002, TASK_TIMING, [], timing),
        _hand_made("versions", "PROTOCOL_VERSION", 300, PROTOCOL_VERSION, [], version),
        _hand_made("an upload's id", "MISSION_ACK", 47, MISSION_ACK, extended, plan),
    ]


def _hand_made(
    name: str,
    kind: str,
    number: int,
    base: list[Field],
    extensions: list[Field],
    values: dict[str, Any],
) -> dict[str, Any]:
    in_order = sorted(base, key=lambda field: -SIZES[field[0]])  # stable: else as defined
    payload = b"".join(_packed(field, values) for field in in_order + extensions)
    payload = payload.rstrip(b"\0") or payload[:1]
    seq, system, component = 200, 1, 191
    body = bytes([len(payload), 0, 0, seq, system, component]) + number.to_bytes(3, "little")
    checksum = crc(body + payload + bytes([crc_extra(kind, in_order)]))
    packet = b"\xfd" + body + payload + checksum.to_bytes(2, "little")
    return _vector(name, kind, seq, system, values, packet)


def _packed(field: Field, values: dict[str, Any]) -> bytes:
    kind, name, length = field
    value = values[name]
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
