"""What vehicles say, in the server's log."""

import logging
from collections.abc import Iterator

import pytest

from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets, PeerChanged
from mav_tasks.logs.vehicle_texts import BURST, RATE, TELL, VehicleTexts
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.services.statustext import chunks

ROVER = Encoder(Address(1, 1))
PEER = ("127.0.0.1", 14580)


@pytest.fixture
def texts(caplog: pytest.LogCaptureFixture) -> Iterator[VehicleTexts]:
    it = VehicleTexts()
    it.on_input(LinkChanged("rovers", LinkSide.VEHICLES, up=True), now=0.0)
    it.on_input(LinkChanged("line", LinkSide.VEHICLES, up=True, is_stream=True), now=0.0)
    it.on_input(LinkChanged("clients", LinkSide.CLIENTS, up=True), now=0.0)
    with caplog.at_level(logging.DEBUG, "mav_tasks"):
        yield it


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    lines = [f"{record.levelname} {record.getMessage()}" for record in caplog.records]
    caplog.clear()
    return lines


def packet(words: str, severity: int = 4, encoder: Encoder = ROVER) -> bytes:
    return encoder.encode(m.Statustext(severity, words.encode()))


def test_a_text_is_said_with_its_severity(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    levels = []
    for severity in range(8):
        texts.on_input(Packets("rovers", [(PEER, packet("PreArm: x", severity))]), now=1.0)
        (line,) = said(caplog)
        level, _, words = line.partition(" ")
        assert words == "rover 1 says: PreArm: x"
        levels.append(level)
    assert levels == ["ERROR"] * 4 + ["WARNING", "INFO", "INFO", "DEBUG"]


def test_other_components_are_named_and_clients_are_not_heard(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    gimbal = Encoder(Address(1, 154))
    texts.on_input(Packets("clients", [(PEER, packet("no"))]), now=1.0)
    texts.on_input(Packets("rovers", [(PEER, packet("hot", encoder=gimbal))]), now=1.0)
    assert said(caplog) == ["WARNING rover 1, component 154, says: hot"]


def test_texts_are_found_beside_other_packets_and_in_mavlink_1(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    beat = ROVER.encode(m.Heartbeat(10, 3, 0, 0, 0, 3))
    old = bytes.fromhex("fe3300010 1fd".replace(" ", "")) + b"\x03old".ljust(51, b"\0")
    from fastcrc.crc16 import mcrf4xx

    old += mcrf4xx(old[1:] + bytes((83,))).to_bytes(2, "little")
    broken = packet("broken")[:-1] + b"?"
    texts.on_input(Packets("rovers", [(PEER, beat + packet("new") + beat)]), now=1.0)
    texts.on_input(Packets("rovers", [(PEER, old), (PEER, broken), (PEER, b"\xfd\0\0")]), now=1.0)
    assert said(caplog) == ["WARNING rover 1 says: new", "ERROR rover 1 says: old"]


def test_a_text_that_two_links_bring_is_said_once(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    """And one that one link brings again is said again."""
    for at, source in ((0.0, PEER), (0.3, "radio"), (3.0, PEER), (3.1, "radio")):
        texts.on_input(Packets("rovers", [(source, packet("hot"))]), now=at)
    assert said(caplog) == ["WARNING rover 1 says: hot"] * 2


@pytest.mark.parametrize("link", ["line", "rovers"])
def test_on_any_link_a_text_may_be_cut_anywhere(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture, link: str
) -> None:
    data = packet("one") + packet("two")
    for at in range(len(data)):
        now = float(at)
        texts.on_input(PeerChanged("line", PEER, up=True), now=now)
        texts.on_input(Packets(link, [(PEER, data[:at])]), now=now)
        texts.on_input(Packets(link, [(PEER, data[at:])]), now=now + 0.1)
        assert said(caplog) == ["WARNING rover 1 says: one", "WARNING rover 1 says: two"]


def test_a_long_text_is_one_line_and_a_part_is_said_when_the_rest_does_not_come(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    parts = [ROVER.encode(each) for each in chunks(MavSeverity.ERROR, "a" * 80, text_id=5)]
    texts.on_input(Packets("rovers", [(PEER, part) for part in parts]), now=1.0)
    assert said(caplog) == [f"ERROR rover 1 says: {'a' * 80}"]
    texts.on_input(Packets("rovers", [(PEER, parts[0])]), now=2.0)
    texts.on_input(None, now=3.0)
    assert said(caplog) == []
    texts.on_input(None, now=10.0)
    assert said(caplog) == [f"ERROR rover 1 says: {'a' * 50}[…]"]
    texts.on_input(Packets("rovers", [(PEER, parts[0])]), now=11.0)
    texts.close()
    assert said(caplog) == [f"ERROR rover 1 says: {'a' * 50}[…]"]


def test_a_text_gives_no_orders_to_a_terminal(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    words = "a\x1b[2J\nERROR forged\r\x07"
    texts.on_input(Packets("rovers", [(PEER, packet(words)), (PEER, packet(" \n"))]), now=1.0)
    assert said(caplog) == ["WARNING rover 1 says: a[2J ERROR forged"]


def test_a_thousand_texts_a_second_are_counted(
    texts: VehicleTexts, caplog: pytest.LogCaptureFixture
) -> None:
    for number in range(10_000):
        data = packet(f"number {number}")
        texts.on_input(Packets("rovers", [(PEER, data)]), now=1.0 + number / 1000)
    shown = len(said(caplog))
    assert shown <= BURST + RATE * 10 + 1
    other = Encoder(Address(2, 1))
    texts.on_input(Packets("rovers", [(PEER, packet("me", encoder=other))]), now=11.0)
    assert said(caplog) == ["WARNING rover 2 says: me"]
    texts.on_input(None, now=2.0 + TELL)
    assert said(caplog) == [f"WARNING rover 1 sends too many texts: {10_000 - shown} omitted"]
    texts.on_input(None, now=100.0)
    assert said(caplog) == []
