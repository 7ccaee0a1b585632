"""What stands in a telemetry log, read back by pymavlink."""

import errno
import os
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("MAVLINK20", "1")

from pymavlink import mavutil

from mav_tasks.engine.inputs import (
    Input,
    LinkChanged,
    LinkSide,
    Outgoing,
    Packets,
    PeerChanged,
    WallClock,
)
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Message
from mav_tasks.recording import tlog as tlog_module
from mav_tasks.recording.new_files import write_all
from mav_tasks.recording.tlog import Tlog
from tests.kit.processes import wait_until

ROVER, SERVER, GCS, OUR_OWN = Address(1, 1), Address(1, 191), Address(255, 190), Address(250, 191)
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


def started(folder: Path, **options: Any) -> Tlog:
    options = {"size": 10**6, "count": 10, "component_id": 191, **options}
    tlog = Tlog(folder, **options)
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


def test_each_packet_stands_there_once_at_its_time(tmp_path: Path) -> None:
    tlog = started(tmp_path)
    came = [packet(heartbeat(), ROVER, 7), packet(attitude(1), ROVER, 8)]
    tlog.on_input(Packets("rovers", [("rover", data) for data in came]), now=1.25)
    passed_on = [to_client(packet(attitude(1), ROVER, 30), peer) for peer in ("gcs", "script")]
    shown = to_client(packet(heartbeat(mode=15), ROVER, 31))  # another mode than its own
    tlog.on_output([*passed_on, shown], [], now=1.25)
    asked = packet(m.CommandLong(1, 191, 54000, 0, 1.0, 0, 0, 0, 0, 0, 5), GCS, 3)
    tlog.on_input(Packets("clients", [("gcs", asked)]), now=1.5)
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
    assert told(tmp_path) == [
        (1.25, "HEARTBEAT", ROVER, 7),
        (1.25, "ATTITUDE", ROVER, 8),
        (1.5, "COMMAND_LONG", GCS, 3),
        (1.5, "COMMAND_ACK", SERVER, 1),
        (1.5, "COMMAND_ACK", ROVER, 32),
        (1.5, "HEARTBEAT", SERVER, 2),
        (1.5, "HEARTBEAT", OUR_OWN, 9),
        (2.0, "ATTITUDE", ROVER, 33),
    ]


def test_an_answer_that_says_the_same_to_two_is_no_copy(tmp_path: Path) -> None:
    tlog = started(tmp_path)
    own = [to_client(packet(ack(54000), SERVER), peer) for peer in ("one", "other")]
    tlog.on_output(own, [], now=1.0)
    tlog.close()
    assert len(told(tmp_path)) == 2


@pytest.mark.parametrize("cut", [1, 5, 17, 300])
def test_a_stream_may_be_cut_anywhere(tmp_path: Path, cut: int) -> None:
    tlog = started(tmp_path)
    tlog.on_input(LinkChanged("tcp", LinkSide.VEHICLES, up=True, is_stream=True), now=0.0)
    tlog.on_input(PeerChanged("tcp", "rover", up=True), now=0.0)
    stream = b"".join(packet(attitude(number), ROVER, number) for number in range(1, 11))
    tlog.on_input(Packets("tcp", [("rover", stream[:3])]), now=0.5)
    tlog.on_input(PeerChanged("tcp", "rover", up=False), now=0.5)  # the torn packet is no more
    for number, start in enumerate(range(0, len(stream), cut)):
        piece = Packets("tcp", [("rover", stream[start : start + cut])])
        tlog.on_input(piece, now=1.0 + number / 1000)
    tlog.close()
    assert [(kind, seq) for _, kind, _, seq in told(tmp_path)] == [
        ("ATTITUDE", number) for number in range(1, 11)
    ]


def test_noise_is_not_logged(tmp_path: Path) -> None:
    tlog = started(tmp_path)
    good = packet(heartbeat(), ROVER, 7)
    bad = good[:-1] + bytes([good[-1] ^ 1])
    tlog.on_input(Packets("rovers", [("x", b"\xfd\x01"), ("x", bad), ("x", b"?" + good)]), now=1.0)
    tlog.close()
    assert told(tmp_path) == [(1.0, "HEARTBEAT", ROVER, 7)]


def test_the_log_goes_on_in_the_next_file(tmp_path: Path) -> None:
    tlog = started(tmp_path, size=2_000, count=3)
    for number in range(400):
        data = packet(attitude(number), ROVER, number % 256)
        tlog.on_input(Packets("rovers", [("rover", data)]), now=1.0 + number)
    tlog.close()
    there = told(tmp_path)
    assert [when for when, *_ in there] == [1.0 + n for n in range(400 - len(there), 400)]
    assert len(there) > 60
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert (len(sizes), max(sizes) <= 2_000) == (3, True)


class Disk:
    """A disk that can be full, or stuck."""

    def __init__(self) -> None:
        self.is_full = False
        self.goes_on = threading.Event()
        self.goes_on.set()
        self.tries = 0

    def write(self, fd: int, data: bytes) -> None:
        self.tries += 1
        self.goes_on.wait()
        if self.is_full:
            write_all(fd, data[:10])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write_all(fd, data)


def wait_for_another_try(disk: Disk, before: int) -> None:
    until(lambda: disk.tries > before)


def until(condition: Callable[[], object]) -> None:
    wait_until(condition, within=10)


def test_a_full_disk_loses_packets_and_is_told_of_twice(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tlog_module, "RETRY", 0.0)
    disk = Disk()
    tlog = started(tmp_path, write=disk.write)
    disk.is_full = True
    for number in range(3):
        before = disk.tries
        data = packet(attitude(number), ROVER, number)
        tlog.on_input(Packets("rovers", [("rover", data)]), now=1.0)
        wait_for_another_try(disk, before)
    until(lambda: caplog.messages)
    disk.is_full = False
    tlog.on_input(Packets("rovers", [("rover", packet(attitude(3), ROVER, 3))]), now=2.0)
    tlog.close()
    name = f"telemetry log in {tmp_path}"
    assert caplog.messages == [
        f"{name}: packets are being lost: No space left on device",
        f"{name}: writing again; 3 packets lost",
    ]
    assert [seq for *_, seq in told(tmp_path)] == [3]


def test_a_disk_that_does_not_answer_keeps_nobody_waiting(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mav_tasks.recording.writing.END_LIMIT", 0.2)
    disk = Disk()
    tlog = started(tmp_path, write=disk.write, most_waiting=10_000)
    disk.goes_on.clear()
    one = Packets("rovers", [("rover", packet(heartbeat(), ROVER))])
    tlog.on_input(one, now=1.0)
    until(lambda: disk.tries)
    for number in range(100):
        tlog.on_input(one, now=2.0 + number)
    tlog.close()  # in bounded time
    disk.goes_on.set()
    until(lambda: "recorder" not in {thread.name for thread in threading.enumerate()})
    name = f"telemetry log in {tmp_path}"
    there = len(told(tmp_path))
    assert 10 < there < 90
    assert caplog.messages == [
        f"{name}: packets are being lost: the disk is too slow",
        f"{name}: incomplete: the disk is too slow",
        f"{name}: writing again; {101 - there} packets lost",
    ]


def test_what_fails_in_the_thread_is_told_and_nothing_else_happens(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def write(fd: int, data: bytes) -> None:
        raise ZeroDivisionError

    tlog = started(tmp_path, write=write, most_waiting=5_000)
    one = Packets("rovers", [("rover", packet(heartbeat(), ROVER))])
    tlog.on_input(one, now=1.0)
    until(lambda: caplog.messages)
    for _ in range(100):
        tlog.on_input(one, now=2.0)
    tlog.close()
    assert "internal error" in caplog.messages[0]
