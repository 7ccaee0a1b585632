"""Golden packets: decode, encode and round trip from one table."""

import json
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Packer
from mav_tasks.mavlink.packet import split_datagram
from tests.vectors.make_vectors import GOLDEN, golden, text_of

VECTORS: list[dict[str, Any]] = json.loads(GOLDEN.read_text(encoding="utf-8"))
KINDS = {kind.msgname: kind for kind in m.ALL.values()}

each = pytest.mark.parametrize("vector", [pytest.param(v, id=v["name"]) for v in VECTORS])


def decoded(packet: bytes) -> m.Message:
    (whole,) = split_datagram(packet)
    message = Decoder().decode(whole)
    assert message is not None
    return message


def shown(message: m.Message) -> dict[str, Any]:
    """Fields as the table writes them."""
    values = {name: getattr(message, name) for name in message.fieldnames}
    return {name: "nan" if value != value else value for name, value in values.items()}


@each
def test_a_golden_packet_is_decoded(vector: dict[str, Any]) -> None:
    (packet,) = split_datagram(bytes.fromhex(vector["packet"]))
    assert (packet.seq, packet.source) == (
        vector["seq"],
        Address(vector["system_id"], vector["component_id"]),
    )
    message = decoded(packet.raw)
    assert (message.get_type(), shown(message)) == (vector["message"], vector["fields"])


@each
def test_a_golden_packet_is_encoded(vector: dict[str, Any]) -> None:
    kind: Any = KINDS[vector["message"]]
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    values = {
        name: value.encode() if types[name] == "char" else float(value) if value == "nan" else value
        for name, value in vector["fields"].items()
    }
    source = Address(vector["system_id"], vector["component_id"])
    assert Packer().pack(kind(**values), source, seq=vector["seq"]).hex() == vector["packet"]


@each
def test_a_golden_packet_survives_the_round_trip(vector: dict[str, Any]) -> None:
    raw = bytes.fromhex(vector["packet"])
    source = Address(vector["system_id"], vector["component_id"])
    assert Packer().pack(decoded(raw), source, seq=vector["seq"]) == raw


@pytest.mark.parametrize("vector", [pytest.param(v, id=v["name"]) for v in VECTORS if "v1" in v])
def test_a_golden_mavlink_1_packet_is_decoded_without_its_extensions(
    vector: dict[str, Any],
) -> None:
    raw = bytes.fromhex(vector["v1"])
    message = decoded(raw)
    size = raw[1]
    base = [name for name in message.fieldnames if name in vector["fields"]]
    for name in base:
        got, meant = shown(message)[name], vector["fields"][name]
        assert got in (meant, 0), name
    assert message.get_type() == vector["message"]
    assert size <= message.unpacker.size


def test_the_table_is_what_its_script_makes() -> None:
    assert GOLDEN.read_text(encoding="utf-8") == text_of(golden())


def test_our_messages_have_the_sizes_of_the_contract() -> None:
    lengths = {v["message"]: len(bytes.fromhex(v["packet"])) for v in VECTORS}
    whole = {v["name"]: bytes.fromhex(v["packet"])[1] for v in VECTORS}
    assert whole["a text without room for a zero"] == 200
    assert whole["a stopped queue of an older server"] == 79  # of 126: the last ones are 0
    assert whole["a stopped queue of a silent rover"] == 91  # to the end of the gateway's name
    assert lengths["TASK_STATUS"] == 10 + 200 + 2
