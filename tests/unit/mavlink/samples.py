"""Random messages of every kind, made and packed by the stock dialect of pymavlink.

It shares no code with ours: it was generated from other definitions, by somebody else.
"""

from random import Random
from typing import Any

from pymavlink.dialects.v20 import common

MessageClass = Any  # pymavlink's classes carry no type information


def raw_packet(kind: MessageClass, payload: bytes) -> bytes:
    """A packet of any payload with a good checksum, not cut at its zeros."""
    head = bytes([len(payload), 0, 0, 9, 1, 2]) + kind.id.to_bytes(3, "little")
    crc: int = common.x25crc(head + payload + bytes([kind.crc_extra])).crc
    packet: bytes = b"\xfd" + head + payload + crc.to_bytes(2, "little")
    return packet


def message_of(kind: MessageClass, random: Random, dialect: Any = common) -> Any:
    """A message of random fields; many are 0, as they often are in life."""
    size = kind.unpacker.size
    payload = bytes(random.randrange(256) * (random.random() < 0.6) for _ in range(size))
    if random.random() < 0.5:
        payload = payload[: random.randrange(size + 1)]
    return dialect.MAVLink(None).decode(bytearray(raw_packet(kind, payload)))


def stock_message(random: Random, *, v1: bool = False) -> Any:
    """A message of a random kind; of those that MAVLink 1 can number, if asked."""
    kinds = [kind for number, kind in common.mavlink_map.items() if not v1 or number < 256]
    return message_of(random.choice(kinds), random)


def stock_packet(
    message: Any,
    *,
    seq: int,
    source: tuple[int, int] = (1, 1),
    v1: bool = False,
    signature: tuple[bytes, int, int] | None = None,
) -> bytes:
    """The packet that stock pymavlink makes of a message; a signature is key, link and time."""
    mav = common.MAVLink(None, srcSystem=source[0], srcComponent=source[1])
    mav.seq = seq
    if signature:
        mav.signing.sign_outgoing = True
        mav.signing.secret_key, mav.signing.link_id, mav.signing.timestamp = signature
    packed: bytes = message.pack(mav, force_mavlink1=v1)
    return packed
