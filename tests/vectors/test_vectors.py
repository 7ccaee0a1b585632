"""Golden packets: decode, encode and round trip from one table."""

import json
from math import nan
from typing import Any

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.packet import split_datagram
from tests.vectors.make_vectors import GOLDEN, golden, text_of

VECTORS: list[dict[str, Any]] = json.loads(GOLDEN.read_text(encoding="utf-8"))
KINDS = {kind.msgname: kind for kind in m.ALL.values()}


def decoded(packet: bytes) -> m.Message:
    (whole,) = split_datagram(packet)
    message = Decoder().decode(whole)
    assert message is not None
    return message


def shown(message: m.Message) -> dict[str, Any]:
    """Fields as the table writes them."""
    values = {name: getattr(message, name) for name in message.fieldnames}
    return {name: "nan" if value != value else value for name, value in values.items()}


def test_golden_packets_are_decoded_and_encoded() -> None:
    for vector in VECTORS:
        raw = bytes.fromhex(vector["packet"])
        source = Address(vector["system_id"], vector["component_id"])
        (packet,) = split_datagram(raw)
        assert (packet.seq, packet.source) == (vector["seq"], source), vector["name"]
        message = decoded(raw)
        assert (message.get_type(), shown(message)) == (vector["message"], vector["fields"])
        assert Packer().pack(message, source, seq=vector["seq"]) == raw, vector["name"]
        kind: Any = KINDS[vector["message"]]
        types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
        values = {
            name: value.encode() if types[name] == "char" else nan if value == "nan" else value
            for name, value in vector["fields"].items()
        }
        assert Packer().pack(kind(**values), source, seq=vector["seq"]) == raw, vector["name"]


def test_golden_mavlink_1_packets_are_decoded_without_their_extensions() -> None:
    for vector in [each for each in VECTORS if "v1" in each]:
        raw = bytes.fromhex(vector["v1"])
        message = decoded(raw)
        assert message.get_type() == vector["message"]
        assert raw[1] <= message.unpacker.size
        for name, value in shown(message).items():
            assert value in (vector["fields"].get(name, value), 0), (vector["name"], name)


def test_the_table_is_what_its_script_makes() -> None:
    assert GOLDEN.read_text(encoding="utf-8") == text_of(golden())
