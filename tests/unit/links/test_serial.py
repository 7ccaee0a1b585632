"""Serial links on pseudo-terminals."""

import os
import select
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mav_tasks.engine.inputs import LinkSide
from mav_tasks.errors import LinkOpenError
from mav_tasks.links import serial
from mav_tasks.links.attempts import RETRY
from mav_tasks.links.base import PeerChange, PeerState, StreamLink
from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES
from mav_tasks.links.memory import MemoryNet
from mav_tasks.links.serial import LEAD, USED, SerialLink, SerialUrl
from mav_tasks.runner import link_changed
from tests.kit.clock import Clock
from tests.kit.lines import Device, device, read_from

BAUD = 57_600
LIMIT = 10.0  # s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(serial, "boot_time", made)
    return made


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Device]:
    with device(tmp_path / "ttyRadio") as made:
        yield made


@pytest.fixture
def link(line: Device, clock: Clock) -> Iterator[SerialLink]:
    made = SerialLink(SerialUrl(str(line.path), BAUD), limits=TO_VEHICLES)
    yield made
    made.close()


def receive(link: SerialLink, until: Callable[[bytes], object]) -> bytes:
    data, end = b"", time.monotonic() + LIMIT
    while not until(data):
        assert time.monotonic() < end, data
        select.select([link.fileno()], [], [], 0.01)
        data += b"".join(piece for _, piece in link.receive(64))
    return data


def test_it_is_a_stream_link_and_not_local(link: SerialLink, line: Device) -> None:
    stream: StreamLink = link
    assert isinstance(stream, StreamLink)
    assert (link.name, link.peers, link.is_local) == (f"serial:{line.path}:{BAUD}", (), False)
    assert link.take_changes() == [PeerChange(str(line.path), PeerState.UP, "is up")]
    assert repr(link) == f"SerialLink({link.name}, up, OutQueue(0 bytes wait, 0 packets dropped))"


def test_the_server_is_told_how_much_it_carries(link: SerialLink) -> None:
    assert link_changed(link, LinkSide.VEHICLES).capacity == BAUD / 10
    assert link_changed(MemoryNet().link("m"), LinkSide.VEHICLES).capacity is None


def test_bytes_pass_both_ways_as_they_are(link: SerialLink, line: Device) -> None:
    every = bytes(range(256))
    os.write(line.far, every)
    assert receive(link, lambda data: len(data) == 256) == every
    link.send(str(line.path), every)
    assert read_from(line.far, 256) == every


def test_a_device_is_nobody_elses(link: SerialLink, line: Device) -> None:
    with pytest.raises(LinkOpenError, match=r"it is in use$"):
        SerialLink(SerialUrl(str(line.path), BAUD), limits=TO_CLIENTS)


def test_no_more_is_written_ahead_than_the_line_takes_in_a_moment(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    """The system would take some thousand bytes, half a second and more of the line."""
    packet = bytes(100)
    for _ in range(10):
        link.send(str(line.path), packet)
    ahead = int(LEAD * USED * BAUD / 10) // 100 + 1
    assert len(read_from(line.far, 100 * ahead)) == 100 * ahead
    assert not select.select([line.far], [], [], 0.0)[0]
    clock.now += 0.1
    link.poll()
    assert len(read_from(line.far, 100 * (10 - ahead))) == 100 * (10 - ahead)


def test_what_goes_first_does_not_wait_behind_all_that_clients_send(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    arrived, written_after = b"", []
    for number in range(200):
        for _ in range(2):  # four times what the line takes
            link.send(str(line.path), b"f" * 280)
        if number % 20 == 10:
            link.send(str(line.path), b"H" * 45, first=True)
        clock.now += 0.025
        link.poll()
        while select.select([line.far], [], [], 0.0)[0]:
            arrived += os.read(line.far, 4096)
        written_after.append(arrived.count(b"H" * 45))
    late = [at // 20 + 1 - written_after[at + 4] for at in range(10, 196, 20)]  # in 0.1 s
    assert late == [0] * 10


def test_on_a_line_that_is_too_slow_the_newest_is_sent_and_whole(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    arrived, numbers = b"", []
    for number in range(400):  # twice what the line takes
        link.send(str(line.path), number.to_bytes(2, "big") + bytes(574))
        clock.now += 0.05
        link.poll()
        while select.select([line.far], [], [], 0.0)[0]:
            arrived += os.read(line.far, 4096)
        if len(arrived) >= 576:
            last = len(arrived) // 576 * 576
            numbers += [arrived[at : at + 2] for at in range(0, last, 576)]
            assert not any(any(arrived[at + 2 : at + 576]) for at in range(0, last, 576))
            arrived = arrived[last:]
            newest = int.from_bytes(numbers[-1], "big")
            assert number - newest <= (TO_VEHICLES.max_age + LEAD) / 0.05 + 1
    assert numbers == sorted(numbers)
    assert 400 / 2 * USED - 10 < len(numbers) < 400 / 2 * USED + 10


def test_congestion_is_told_and_its_end(link: SerialLink, line: Device, clock: Clock) -> None:
    link.take_changes()
    states = []
    for step in range(20):
        for _ in range(5 if step < 8 else 0):
            link.send(str(line.path), bytes(280))
        clock.now += 0.05
        link.poll()
        states += [(step, change.state) for change in link.take_changes()]
    assert [state for _, state in states] == [PeerState.CONGESTED, PeerState.CLEAR]
    assert states[0][0] <= 4


def test_a_line_that_takes_nothing_holds_nobody_up(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    for _ in range(20_000):
        link.send(str(line.path), bytes(280))
        clock.now += 0.05
    assert link.lost > 15_000
    assert not link._queue.size > 1 << 16


def test_a_device_that_is_not_there_is_waited_for(tmp_path: Path, clock: Clock) -> None:
    path = tmp_path / "ttyLater"
    link = SerialLink(SerialUrl(str(path), BAUD), limits=TO_VEHICLES)
    link.send(str(path), b"lost")
    for _ in range(5):
        clock.now += RETRY
        link.poll()
    words = "is not available yet: No such file or directory; trying again every second"
    assert link.take_changes() == [PeerChange(str(path), PeerState.DOWN, words)]
    with device(path) as line:
        clock.now += RETRY
        link.poll()
        assert link.take_changes() == [PeerChange(str(path), PeerState.UP, "is up")]
        link.send(str(path), b"hello")
        assert read_from(line.far, 5) == b"hello"
    assert link.lost == 1
    link.close()


def test_a_device_that_is_unplugged_is_opened_again(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    fileno = link.fileno()
    link.take_changes()
    for _ in range(3):
        os.write(line.far, b"last")
        assert receive(link, lambda data: data) == b"last"
        line.unplug()
        assert select.select([link.fileno()], [], [], LIMIT)[0]
        assert link.receive(64) == []
        (change,) = link.take_changes()
        assert change.state is PeerState.DOWN
        assert change.words.startswith("lost: ")
        assert link.receive(64) == []
        assert not select.select([link.fileno()], [], [], 0.0)[0]
        line.plug()
        clock.now += RETRY
        link.poll()
        assert link.take_changes() == [PeerChange(str(line.path), PeerState.UP, "is back")]
        link.send(str(line.path), b"hello")
        assert read_from(line.far, 5) == b"hello"
    assert link.fileno() == fileno


def test_it_is_unplugged_while_something_is_sent(
    link: SerialLink, line: Device, clock: Clock
) -> None:
    line.unplug()
    for _ in range(3):
        link.send(str(line.path), b"hello")
    assert [change.state for change in link.take_changes()] == [PeerState.UP, PeerState.DOWN]


@pytest.mark.parametrize(
    ("path", "words"), [("/dev/null", "not a serial device"), ("/tmp", "directory")]
)
def test_what_is_no_serial_device_is_one_clear_error(path: str, words: str) -> None:
    with pytest.raises(LinkOpenError, match=rf"^link serial:{path}:{BAUD} cannot be .*{words}"):
        SerialUrl(path, BAUD).open(limits=TO_VEHICLES)


def test_a_plain_file_is_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"")
    with pytest.raises(LinkOpenError, match="not a serial device"):
        SerialUrl(str(path), BAUD).open(limits=TO_VEHICLES)
