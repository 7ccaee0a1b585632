"""Bytes that never become a packet are told in the log: of a wrong baud rate, for instance."""

import logging

import pytest

from mav_tasks.engine.inputs import LinkChanged, LinkSide, Packets
from mav_tasks.logs.unreadable import Unreadable
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder

ROVER, STRANGER = ("10.0.0.2", 14550), ("10.0.0.3", 2323)
BEAT = Encoder(Address(1, 1)).encode(m.Heartbeat(10, 3, 0, 0, 0, 3))


@pytest.mark.parametrize("is_stream", [True, False])
def test_who_sends_bytes_and_never_a_packet_is_named_once(
    caplog: pytest.LogCaptureFixture, is_stream: bool
) -> None:
    it = Unreadable()
    it.on_input(LinkChanged("rovers", LinkSide.VEHICLES, up=True, is_stream=is_stream), now=0.0)
    with caplog.at_level(logging.WARNING, "mav_tasks"):
        for step in range(200):
            piece = BEAT[step * 7 % 21 :][:7]
            it.on_input(Packets("rovers", [(ROVER, piece)]), now=0.1 * step)
            it.on_input(Packets("rovers", [(STRANGER, b"\xfd\x80$GPGGA")]), now=0.1 * step)
    (line,) = [record.getMessage() for record in caplog.records]
    assert line == (
        "link rovers: 408 bytes came from 10.0.0.3:2323 in 5 s, and not one whole MAVLink packet:"
        " check the baud rate, and that the port speaks MAVLink"
    )
