"""What --verbose tells of links: who is heard, once, and how much came in."""

import logging

import pytest

from mav_tasks.engine.inputs import Congestion, LinkChanged, LinkSide, Packets, PeerChanged
from mav_tasks.logs.field_notes import MOST_PEERS, PERIOD, FieldNotes


def test_who_is_heard_is_told_once_and_counts_now_and_then(
    caplog: pytest.LogCaptureFixture,
) -> None:
    notes = FieldNotes(lambda: "many")
    a, b = ("127.0.0.1", 5000), "/dev/ttyUSB0"
    with caplog.at_level(logging.DEBUG, "mav_tasks"):
        notes.on_input(LinkChanged("x", LinkSide.VEHICLES, up=True), now=0.0)
        for tick in range(100):
            notes.on_input(Packets("x", [(a, b"?"), (b, b"?")]), now=tick * PERIOD / 50)
        notes.on_input(Congestion("x", b, is_congested=True), now=PERIOD * 2 - 0.1)
        notes.on_input(PeerChanged("x", b, up=True), now=PERIOD * 2 - 0.1)
        notes.on_input(Packets("x", [(b, b"?")]), now=PERIOD * 2 - 0.1)
        notes.close()
    assert [record.getMessage() for record in caplog.records] == [
        "link x for vehicles",
        "link x for vehicles: first bytes from 127.0.0.1:5000",
        "link x for vehicles: first bytes from /dev/ttyUSB0",
        "received so far: many",
        "link x: /dev/ttyUSB0 is congested",
        "link x for vehicles: first bytes from /dev/ttyUSB0",
        "received so far: many",
    ]


def test_no_more_are_remembered_than_fit() -> None:
    notes = FieldNotes(lambda: "")
    for port in range(3 * MOST_PEERS):
        notes.on_input(Packets("x", [(("127.0.0.1", port), b"?")]), now=0.0)
    assert repr(notes) == f"FieldNotes({MOST_PEERS} heard)"
