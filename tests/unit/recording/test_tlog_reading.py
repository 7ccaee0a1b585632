"""A telemetry log is read piece by piece, whatever is in it; the pieces, joined, are the file."""

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.errors import RecordError
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.recording.tlog_reading import BLOCK, Piece, pieces
from tests.unit.recording.odd_packets import SIGNED, UNKNOWN, V1, WRONG_CRC

ROVER = Address(1, 1)
START = 1_763_726_400_000_000  # us


def stamped(raw: bytes, stamp: int = START) -> bytes:
    return struct.pack(">Q", stamp) + raw


def attitudes(count: int) -> list[bytes]:
    encoder = Encoder(ROVER)
    return [
        stamped(encoder.encode(m.Attitude(n, 0.5, -1.5, 3.0, 0, 0, 0)), START + n)
        for n in range(1, count + 1)
    ]


def read(path: Path, data: bytes) -> list[Piece]:
    path.write_bytes(data)
    found = list(pieces(path))
    assert b"".join(piece.data for piece in found) == data
    return found


def packets(found: list[Piece]) -> list[bytes]:
    return [piece.packet.raw for piece in found if piece.packet is not None]


def test_each_packet_has_its_time(tmp_path: Path) -> None:
    logged = attitudes(3)
    found = read(tmp_path / "log", b"".join(logged))
    assert [piece.data for piece in found] == logged
    assert [piece.stamp - START for piece in found] == [1, 2, 3]
    assert packets(found) == [each[8:] for each in logged]


def test_times_may_repeat_and_go_back(tmp_path: Path) -> None:
    raw = attitudes(1)[0][8:]
    times = [START, START, START - 5, 0, (1 << 64) - 1]
    found = read(tmp_path / "log", b"".join(stamped(raw, time) for time in times))
    assert [piece.stamp for piece in found] == times


@pytest.mark.parametrize("odd", [SIGNED, UNKNOWN, V1, WRONG_CRC], ids=lambda raw: raw.hex()[:20])
def test_odd_packets_are_packets(tmp_path: Path, odd: bytes) -> None:
    first, second, third = attitudes(3)
    found = read(tmp_path / "log", first + stamped(odd) + second + third)
    assert packets(found) == [first[8:], odd, second[8:], third[8:]]
    assert packets(read(tmp_path / "log", first + stamped(odd))) == [first[8:], odd]


def test_a_log_may_end_anywhere(tmp_path: Path) -> None:
    first, second = attitudes(2)
    for cut in range(1, len(second)):
        *_, last, rest = read(tmp_path / "log", first + second[:cut])
        assert last.data == first
        assert rest == Piece(second[:cut], last.stamp, None)


@pytest.mark.parametrize("length", [1, 7, 300, 3 * BLOCK])
def test_bytes_between_packets_are_kept(tmp_path: Path, length: int) -> None:
    first, second = attitudes(2)
    found = read(tmp_path / "log", first + b"\xfd" * length + second)
    assert packets(found) == [first[8:], second[8:]]
    assert max(len(piece.data) for piece in found) <= 2 * BLOCK


def test_no_packet_is_lost_where_the_file_is_read_in_blocks(tmp_path: Path) -> None:
    logged = attitudes(8000)
    assert sum(map(len, logged)) > 4 * BLOCK
    found = read(tmp_path / "log", b"".join(logged))
    assert [piece.data for piece in found] == logged


@given(junk=st.binary(max_size=400), place=st.integers(1, 40), cut=st.integers(0, 60))
def test_whatever_is_in_it(
    tmp_path_factory: pytest.TempPathFactory, junk: bytes, place: int, cut: int
) -> None:
    logged = attitudes(40)
    data = b"".join(logged[:place]) + junk + b"".join(logged[place:])
    read(tmp_path_factory.getbasetemp() / "log", data[: len(data) - cut])


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "empty"),
        (b"\0", "not a telemetry log"),
        (b"just some text, and not little of it" * 10, "not a telemetry log"),
        (b"\0" * 100_000, "not a telemetry log"),
        (attitudes(1)[0][:-1], "not a telemetry log"),
    ],
)
def test_another_file_is_named(tmp_path: Path, data: bytes, words: str) -> None:
    with pytest.raises(RecordError, match=rf"log: {words}$"):
        read(tmp_path / "log", data)


def test_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"none: No such file or directory$"):
        list(pieces(tmp_path / "none"))
    with pytest.raises(RecordError, match=r": not a file$"):
        list(pieces(tmp_path))
