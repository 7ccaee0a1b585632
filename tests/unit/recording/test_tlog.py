"""What stands in a telemetry log, read back by pymavlink."""

import os
import shutil
from collections.abc import Iterable
from itertools import count
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from mav_tasks.basics.errors import RecordError
from mav_tasks.config.settings import Recording, Settings
from mav_tasks.engine.inputs import (
    AtOnce,
    Input,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    WallClock,
)
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.recording import observers
from mav_tasks.recording.observer import EngineObserver
from mav_tasks.recording.tlog import Tlog
from tests.kit.processes import wait_until

ROVER, SERVER, GCS, OUR_OWN = Address(1, 1), Address(1, 191), Address(255, 190), Address(250, 191)
#: a heartbeat in MAVLink 1
OLD = bytes.fromhex("fe0909010100000000000a0300040301a4")
OFFSET = 1_763_726_400.0  # UTC - monotonic
LINKS: list[Input] = [
    LinkChanged("rovers", LinkSide.VEHICLES, up=True),
    LinkChanged("clients", LinkSide.CLIENTS, up=True),
    WallClock(OFFSET),
]


def heartbeat(mode: int = 0) -> Message:
    return m.Heartbeat(10, 3, 0, mode, 4, 3)


def attitude(when: int) -> Message:
    return m.Attitude(when, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def ack(command: int) -> Message:
    return m.CommandAck(command, 0, 0, 0, 255, 190)


def packet(message: Message, source: Address, seq: int = 0) -> bytes:
    return Encoder(source, first_seq=seq).encode(message)


def to_client(data: bytes, peer: str = "gcs") -> Outgoing:
    return Outgoing("clients", peer, data)


def started(folder: Path, **options: Any) -> EngineObserver:
    recording = Recording(tlog=str(folder), **options)
    (tlog,) = observers(recording, Settings(), None, now=0.0, utc=OFFSET + 1)
    for item in LINKS:
        tlog.on_input(item, now=0.0)
    return tlog


def read_back(folder: Path) -> Iterable[tuple[float, Any]]:
    """What pymavlink finds: time and message, of all files in their order."""
    for path in sorted(folder.glob("*.tlog"), key=lambda p: (len(p.name), p.name)):
        log = mavutil.mavlink_connection(str(path))
        while (message := log.recv_msg()) is not None:
            yield message._timestamp, message
        log.close()


def told(folder: Path) -> list[tuple[float, str, tuple[int, int], int]]:
    return [
        (
            round(when - OFFSET, 6),
            message.get_type(),
            (message.get_srcSystem(), message.get_srcComponent()),
            message.get_seq(),
        )
        for when, message in read_back(folder)
    ]


LOGGED = """1.25 HEARTBEAT (1, 1) 7
1.25 ATTITUDE (1, 1) 8
1.25 HEARTBEAT (1, 1) 9
1.5 COMMAND_LONG (255, 190) 3
1.5 COMMAND_ACK (1, 191) 1
1.5 COMMAND_ACK (1, 1) 32
1.5 HEARTBEAT (1, 191) 2
1.5 HEARTBEAT (250, 191) 9
2.0 ATTITUDE (1, 1) 33"""


def test_each_packet_stands_there_once_at_its_time(tmp_path: Path) -> None:
    tlog = started(tmp_path)
    came = [packet(heartbeat(), ROVER, 7), packet(attitude(1), ROVER, 8), OLD, OLD[:-1] + b"?"]
    tlog.on_input(Packets("rovers", [("rover", data) for data in came]), now=1.25)
    passed_on = [to_client(packet(attitude(1), ROVER, 30), peer) for peer in ("gcs", "script")]
    passed_on.append(to_client(OLD))
    shown = to_client(packet(heartbeat(mode=15), ROVER, 31))  # another mode than its own
    tlog.on_output([*passed_on, shown], [], now=1.25)
    asked = packet(m.CommandLong(1, 191, 54000, 0, 1.0, 0, 0, 0, 0, 0, 5), GCS, 3)
    secret = packet(m.SetupSigning(1, 1, [107] * 32, 0), GCS, 4)  # which no log has
    tlog.on_input(Packets("clients", [("gcs", asked), ("gcs", secret)]), now=1.5)
    own = [
        to_client(packet(ack(54000), SERVER, 1)),
        to_client(packet(ack(400), ROVER, 32)),  # in the autopilot's name
        *(to_client(packet(heartbeat(), SERVER, 2), peer) for peer in ("gcs", "script")),
    ]
    setpoint = packet(heartbeat(), OUR_OWN, 9)
    tlog.on_output([*own, Outgoing("rovers", "rover", setpoint, True)], [], now=1.5)
    tlog.on_input(None, now=2.0)
    tlog.on_output([to_client(packet(attitude(1), ROVER, 33))], [], now=2.0)  # of our own accord
    tlog.close()
    assert "\n".join(" ".join(map(str, each)) for each in told(tmp_path)) == LOGGED


def test_the_log_goes_on_in_the_next_file(tmp_path: Path) -> None:
    tlog = started(tmp_path, tlog_size=2_000, tlog_files=3)
    for number in range(400):
        data = packet(attitude(number), ROVER, number % 256)
        tlog.on_input(Packets("rovers", [("rover", data)]), now=1.0 + number)
    tlog.close()
    there = told(tmp_path)
    assert [when for when, *_ in there] == [1.0 + n for n in range(400 - len(there), 400)]
    assert len(there) > 60
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert (len(sizes), max(sizes) <= 2_000) == (3, True)


def test_only_the_oldest_of_ours_are_removed_and_nothing_is_written_over(tmp_path: Path) -> None:
    others = ["notes.tlog", "2025-11-21T12-00-00Z.tlog.old", "2024-01-01T00-00-00Z.raw"]
    old = [f"2024-01-01T00-00-00Z.{n}tlog" for n in ("", "9.", "10.")]
    for name in [*others, *old]:
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "2023-01-01T00-00-00Z.tlog").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "2025-11-21T12-00-01Z.tlog").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "2023-01-02T00-00-00Z.tlog").mkdir()
    others += [
        "2023-01-01T00-00-00Z.tlog",
        "2023-01-02T00-00-00Z.tlog",
        "2025-11-21T12-00-01Z.tlog",
    ]
    tlog = started(tmp_path, tlog_size=2_000, tlog_files=3)
    for number in range(150):
        data = packet(attitude(number), ROVER, number)
        tlog.on_input(Packets("rovers", [("rover", data)]), now=1.0)
    tlog.close()
    made = ["2025-11-21T12-00-01Z.1.tlog", "2025-11-21T12-00-01Z.2.tlog"]
    assert {path.name for path in tmp_path.iterdir()} == {*others, old[2], *made}
    assert (tmp_path / made[0]).stat().st_mode & 0o777 == 0o600


def test_a_folder_that_cannot_be_used_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_bytes(b"")
    monkeypatch.setenv("HOME", str(tmp_path))
    for folder, words in (
        (f"{tmp_path}/file/folder", "cannot write records to .*/file/folder: Not a dir"),
        (f"{tmp_path}/file", "not a folder"),
        ("~nobody.there/logs", r"cannot write records to ~nobody\.there/logs: "),
    ):
        with pytest.raises(RecordError, match=words):
            started(Path(folder))
    started(Path("~/logs")).close()  # in a file or a variable no shell makes it the home
    assert (tmp_path / "logs").is_dir()


def test_a_log_that_was_removed_with_its_folder_is_begun_anew(tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    tlog = started(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    numbers = count()

    def is_logged() -> bool:
        """Log one more packet: the one before may have been written as the folder went."""
        number = next(numbers)
        data = packet(attitude(number), ROVER, number)
        tlog.on_input(Packets("rovers", [("rover", data)]), now=1.0)
        return any(folder.glob("*"))

    wait_until(is_logged, within=10)
    shutil.rmtree(folder)
    wait_until(is_logged, within=10)
    tlog.close()
    assert [seq for *_, seq in told(folder)][-1] == next(numbers) - 1


def test_what_a_slow_disk_loses_is_counted_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tlog = Tlog(tmp_path, size=10_000, count=3, component_id=191, start="x", most_waiting=100)
    data = Packets("rovers", [("rover", packet(attitude(1), ROVER))])
    tlog.on_input(AtOnce((data, data)), now=1.0)
    tlog.on_output([to_client(b"")], [], now=1.0)
    tlog.close()
    lost = "packets are being lost: the disk is too slow", "writing again; 3 packets lost"
    assert caplog.messages == [f"telemetry log in {tmp_path}: {words}" for words in lost]
