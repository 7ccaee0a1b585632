"""Serial links on pseudo-terminals."""

import os
import select
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mav_tasks.basics.errors import LinkOpenError
from mav_tasks.links import TO_CLIENTS, TO_VEHICLES, parse_url
from mav_tasks.links.base import CountingLink, PacedLink, PeerChange, PeerState, StreamLink
from tests.kit.lines import Device, device, read_from

BAUD = 57_600
LIMIT = 10.0  # s


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Device]:
    with device(tmp_path / "ttyRadio") as made:
        yield made


@pytest.fixture
def link(line: Device) -> Iterator[StreamLink]:
    made = opened(line.path)
    yield made
    made.close()


def opened(path: Path) -> StreamLink:
    link = parse_url(f"serial:{path}:{BAUD}").open(limits=TO_VEHICLES)
    assert isinstance(link, StreamLink)
    return link


def polled(link: StreamLink, until: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT
    while not until():
        assert time.monotonic() < end
        link.poll()
        time.sleep(0.01)


def changes_of(link: StreamLink) -> list[PeerChange]:
    """Return the next changes."""
    found: list[PeerChange] = []

    def are_there() -> bool:
        found.extend(link.take_changes())
        return bool(found)

    polled(link, are_there)
    return found


def receive(link: StreamLink, count: int) -> bytes:
    data, end = b"", time.monotonic() + LIMIT
    while len(data) < count:
        assert time.monotonic() < end, data
        select.select([link.fileno()], [], [], 0.01)
        data += b"".join(piece for _, piece in link.receive(64))
    return data


def test_bytes_pass_both_ways_as_they_are(link: StreamLink, line: Device) -> None:
    assert (link.name, link.peers, link.is_local) == (f"serial:{line.path}:{BAUD}", (), False)
    assert isinstance(link, PacedLink)
    assert link.capacity == BAUD / 10
    assert link.take_changes() == [PeerChange(str(line.path), PeerState.UP, "is up")]
    every = bytes(range(256))
    os.write(line.far, every)
    assert receive(link, 256) == every
    link.send(str(line.path), every)
    assert read_from(line.far, 256) == every


def test_on_a_line_that_is_too_slow_packets_are_whole_the_newest_and_those_that_are_first_pass(
    link: StreamLink, line: Device
) -> None:
    """The system would take some thousand bytes, half a second and more of the line."""
    link.take_changes()
    began, states, arrived = time.monotonic(), [], list[tuple[bytes, float]]()
    first_at: dict[int, float] = {}
    rest = b""
    for number in range(240):  # four times what the line takes
        is_first = number in range(20, 200, 40)  # the last one still arrives before the end
        if is_first:
            first_at[number] = time.monotonic()
        head = (b"\xfe" if is_first else b"\xff") + number.to_bytes(2, "big")
        link.send(str(line.path), head + bytes(277), first=is_first)
        while time.monotonic() < began + number * 0.0125:
            link.poll()
            states += [change.state for change in link.take_changes()]
            if select.select([line.far], [], [], 0.002)[0]:
                rest += os.read(line.far, 4096)
            while len(rest) >= 280:
                arrived.append((rest[:280], time.monotonic()))
                rest = rest[280:]
    assert {packet[3:] for packet, _ in arrived} == {bytes(277)}
    numbered = [(packet[0], int.from_bytes(packet[1:3], "big"), at) for packet, at in arrived]
    ordinary = [number for kind, number, _ in numbered if kind == 0xFF]
    assert ordinary == sorted(ordinary)
    assert 239 - ordinary[-1] < (TO_VEHICLES.max_age + 0.3) / 0.0125
    assert 0.5 < 280 * len(arrived) / (BAUD / 10 * (time.monotonic() - began)) < 1.1
    late = [at - first_at[number] for kind, number, at in numbered if kind == 0xFE]
    assert len(late) == len(first_at)
    assert max(late) < 0.3
    assert states == [PeerState.CONGESTED]
    assert [change.state for change in changes_of(link)] == [PeerState.CLEAR]


def test_a_device_that_is_not_there_is_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "ttyLater"
    link = opened(path)
    link.send(str(path), b"lost")
    words = "is not available yet: No such file or directory; trying again every second"
    assert changes_of(link) == [PeerChange(str(path), PeerState.DOWN, words)]
    with device(path) as line:
        assert changes_of(link) == [PeerChange(str(path), PeerState.UP, "is up")]
        link.send(str(path), b"hello")
        assert read_from(line.far, 5) == b"hello"
    assert isinstance(link, CountingLink)
    assert link.lost == 1
    link.close()


def test_a_device_that_is_unplugged_is_opened_again(link: StreamLink, line: Device) -> None:
    fileno = link.fileno()
    link.take_changes()
    os.write(line.far, b"last")
    assert receive(link, 4) == b"last"
    line.unplug()
    assert select.select([link.fileno()], [], [], LIMIT)[0]
    link.send(str(line.path), b"lost")
    assert link.receive(64) == []
    (change,) = link.take_changes()
    assert (change.state, change.words[:6]) == (PeerState.DOWN, "lost: ")
    assert not select.select([link.fileno()], [], [], 0.0)[0]
    line.plug()
    assert changes_of(link) == [PeerChange(str(line.path), PeerState.UP, "is back")]
    link.send(str(line.path), b"hello")
    assert read_from(line.far, 5) == b"hello"
    assert link.fileno() == fileno


def test_what_cannot_be_opened_is_one_clear_error(
    link: StreamLink, line: Device, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.touch()
    for path, words in (
        ("/dev/null", "not a serial device"),
        (file, "not a serial device"),
        ("/tmp", "directory"),
        (line.path, "it is in use"),
    ):
        with pytest.raises(LinkOpenError, match=rf"^link serial:{path}:{BAUD} cannot be .*{words}"):
            parse_url(f"serial:{path}:{BAUD}").open(limits=TO_CLIENTS)
