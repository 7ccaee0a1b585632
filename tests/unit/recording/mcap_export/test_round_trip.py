"""Recordings become an MCAP file, in which telemetry logs are byte by byte."""

import json
from collections import defaultdict
from math import isfinite
from pathlib import Path
from random import Random
from struct import pack
from typing import Any

import pytest

pytest.importorskip("mcap", reason="the extra mcap is not installed")

from mcap.reader import NonSeekingReader, make_reader

from mav_tasks.basics.errors import RecordError, UsageError
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.layout import Layout
from mav_tasks.recording.mcap_export.convention import RAW
from mav_tasks.recording.mcap_export.exporting import Counts, export
from tests.kit.commands import session
from tests.unit.recording.mcap_export.json_schema import check, check_schema
from tests.unit.recording.odd_packets import SIGNED, UNKNOWN, V1, WRONG_CRC

ROVER, OTHER, GCS = Address(1, 1), Address(2, 1), Address(255, 190)
START = 1_763_726_400_000_000  # us


def stamped(raw: bytes, stamp: int = START) -> bytes:
    return pack(">Q", stamp) + raw


def attitudes(count: int, source: Address = ROVER, start: int = START) -> list[bytes]:
    encoder = Encoder(source)
    return [
        stamped(encoder.encode(m.Attitude(n, 0.5, -1.5, 3.0, 0, 0, 0)), start + 1000 * n)
        for n in range(1, count + 1)
    ]


def exported(folder: Path, **logs: bytes) -> tuple[Path, Counts]:
    """Export logs of these names; return the file."""
    paths = [folder / f"{name}.tlog" for name in logs]
    for path, data in zip(paths, logs.values(), strict=True):
        path.write_bytes(data)
    return made_of(folder, *paths)


def made_of(folder: Path, *paths: Path) -> tuple[Path, Counts]:
    out = folder / "out.mcap"
    with out.open("wb") as file:
        counts = export(paths, file)
    check_messages(out)
    return out, counts


def check_messages(path: Path) -> None:
    """Read a file with the package's own reader, its checksums, and all messages by schema."""
    checked = set()
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if channel.message_encoding == "json":
                assert schema is not None
                assert schema.encoding == "jsonschema"
                if schema.id not in checked:
                    checked.add(schema.id)
                    check_schema(json.loads(schema.data))
                check(json.loads(message.data), json.loads(schema.data), channel.topic)
    with path.open("rb") as file:
        summary = NonSeekingReader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert all(chunk.compression == "" for chunk in summary.chunk_indexes)


def json_of(path: Path) -> dict[str, list[Any]]:
    """Return what each topic but the raw one has, decoded."""
    found = defaultdict(list)
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding == "json":
                found[channel.topic].append(json.loads(message.data))
    return found


def raw_of(path: Path) -> dict[str, bytes]:
    """Return the telemetry logs in a file, by their names."""
    found: dict[str, bytes] = defaultdict(bytes)
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=[RAW], log_time_order=False)
        for _, channel, message in messages:
            found[channel.metadata["file"]] += message.data
    return found


FIRST, SECOND, THIRD = attitudes(3)
ODD: dict[str, bytes] = {
    "one packet": FIRST,
    "signed": FIRST + stamped(SIGNED) + SECOND,
    "an unknown id": FIRST + stamped(UNKNOWN) + SECOND,
    "MAVLink 1": FIRST + stamped(V1) + SECOND,
    "a wrong CRC": FIRST + stamped(WRONG_CRC) + SECOND,
    "the end cut off": FIRST + SECOND[:-5],
    "the end within a time": FIRST + SECOND[:3],
    "noise between": FIRST + b"\xfd\x00noise\xfe" * 40 + SECOND,
    "times that repeat": b"".join(stamped(FIRST[8:]) for _ in range(5)),
    "times that go back": FIRST + stamped(SECOND[8:], START - 10**9) + THIRD,
    "no clock": b"".join(stamped(FIRST[8:], time) for time in range(3)),
    "times beyond MCAP's": FIRST + stamped(SECOND[8:], (1 << 64) - 1) + THIRD,
    "several rovers": b"".join(attitudes(9) + attitudes(9, OTHER) + attitudes(9, GCS)),
    "much": b"".join(attitudes(8_000)),
}


def test_a_log_is_in_the_file_as_it_was_whatever_is_in_it(tmp_path: Path) -> None:
    random = Random(20)
    for number in range(10):
        junk, place = random.randbytes(random.randrange(400)), random.randrange(1, 40)
        logged = attitudes(40)
        ODD[f"junk {number} of seed 20"] = b"".join([*logged[:place], junk, *logged[place:]])
    for name, log in ODD.items():
        path, _ = exported(tmp_path, log=log)
        assert raw_of(path) == {"log.tlog": log}, name


def bits(value: Any, on_wire: str) -> Any:
    if not isinstance(value, float):
        return value
    return pack("<f" if on_wire == "float" else "<d", value + 0.0) if isfinite(value) else None


def test_all_fields_of_each_message_are_told_to_the_last_bit(tmp_path: Path) -> None:
    encoder, sent = Encoder(ROVER), {}
    for kind in m.ALL.values():
        layout, size = Layout(kind), kind.unpacker.size
        values = map(
            kind.unpacker.unpack, (Random(17).randbytes(size), bytes(size), b"\xff" * size)
        )
        sent[f"/mavlink/1/1/{kind.msgname}"] = [kind(*layout.order(each)) for each in values]
    log = b"".join(stamped(encoder.encode(each)) for three in sent.values() for each in three)
    path, _ = exported(tmp_path, log=log)
    told = json_of(path)
    for topic, messages in sent.items():
        for message, values in zip(messages, told[topic], strict=True):
            assert list(values) == message.fieldnames
            for name, on_wire in zip(message.fieldnames, message.fieldtypes, strict=True):
                given, came = getattr(message, name), values[name]
                if not isinstance(given, list):
                    given, came = [given], [came]
                floats = on_wire in ("float", "double")
                came = [float(each) if floats and each is not None else each for each in came]
                assert [bits(v, on_wire) for v in came] == [bits(v, on_wire) for v in given], topic


def test_what_the_dialect_does_not_know_is_counted_and_raw_only(tmp_path: Path) -> None:
    log = FIRST + stamped(UNKNOWN) + stamped(WRONG_CRC) + SECOND + b"the rest"
    path, counts = exported(tmp_path, log=log)
    assert counts == Counts(packets=4, events=0, raw_only=2, other_bytes=8)
    assert {topic: len(found) for topic, found in json_of(path).items()} == {
        "/mavlink/1/1/ATTITUDE": 2
    }


def test_logs_of_one_run_are_merged_by_time(tmp_path: Path) -> None:
    early = b"".join(attitudes(100))
    late = b"".join(attitudes(100, start=START + 50_500))
    path, _ = exported(tmp_path, b=late, a=early)
    assert raw_of(path) == {"a.tlog": early, "b.tlog": late}
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(log_time_order=False)
        times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)


def test_another_file_is_named(tmp_path: Path) -> None:
    path, _ = exported(tmp_path, log=FIRST)
    for name, words in (("none", "No such file"), (".", "not a file")):
        with pytest.raises(RecordError, match=words):
            made_of(tmp_path, tmp_path / name)
    with pytest.raises(UsageError, match="two recordings are named"):
        made_of(tmp_path, path, path)
    text = b"just some text, and not little of it" * 10
    for data in (b"", b"\0", text, b"\0" * 100_000, FIRST[:-1]):
        with pytest.raises(RecordError, match=r"log.tlog: (not a telemetry log|empty)$"):
            exported(tmp_path, log=data)


#: commands and what they say; a.tlog has a packet that nobody knows, and other bytes
COMMANDS = """export FOLDER/a.tlog --mcap FOLDER/a.mcap => 0 FOLDER/a.mcap: 4 packets … \
1 packets could not be decoded … ; 7 bytes belong to no packet
export FOLDER/a.tlog --mcap FOLDER/c.mcap --json => 0 {"done": "export", "file": "FOLDER/c.mcap"
export FOLDER/a.tlog FOLDER/b.tlog --mcap FOLDER/b.mcap => 0 FOLDER/b.mcap: 7 packets"""


def test_the_command_says_what_it_has_written(tmp_path: Path) -> None:
    odd = b"".join([*attitudes(3), stamped(UNKNOWN)]) + b"garbage"
    for name, data in (("a", odd), ("b", b"".join(attitudes(3)))):
        (tmp_path / f"{name}.tlog").write_bytes(data)
    session("", COMMANDS.replace("FOLDER", str(tmp_path)))
