"""The server's log beside its events: who is heard, what rovers say, and what a reader misses."""

import logging
import os
import re

import pytest

from mav_tasks.engine.inputs import Congestion, LinkChanged, LinkSide, Packets, PeerChanged
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Statustext
from mav_tasks.shell.logs.field_notes import FieldNotes
from mav_tasks.shell.logs.lines import Lines, json_line
from mav_tasks.shell.logs.vehicle_texts import VehicleTexts
from mav_tasks.shell.logs.writing import ThreadedHandler

HEARD = """link x for vehicles
rover 1 says: hot
link x for vehicles: first bytes from radio
link x for vehicles: first bytes from wire
rover 1 says: cut...............................................[…]
link x: wire is congested
received so far: many
link x for vehicles: first bytes from wire
link x for vehicles: first bytes from radio"""


def test_who_is_heard_and_what_rovers_say_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    texts = Statustext(4, b"hot"), Statustext(4, b" \n"), Statustext(4, b"cut".ljust(50, b"."), 5)
    hot, *rest = map(Encoder(Address(1, 1)).encode, texts)
    caplog.set_level(logging.DEBUG, "mav_tasks")
    observers = VehicleTexts(), FieldNotes(lambda: "many")
    for now, item in (
        (0, LinkChanged("x", LinkSide.VEHICLES, up=True)),
        (
            0,
            Packets("x", [("radio", hot), ("wire", b"".join([hot, *rest, hot[:-1], b"?"]))]),
        ),
        (70, Congestion("x", "wire", is_congested=True)),
        (70, PeerChanged("x", "wire", up=True)),
        (70, Packets("x", [("wire", b"?"), *((n, b"?") for n in range(300)), ("radio", b"?")])),
    ):
        for observer in observers:
            observer.on_input(item, now=now)
    assert [each for each in caplog.messages if not each[-1].isdigit()] == HEARD.splitlines()


def test_a_log_that_nobody_reads_says_how_many_lines_are_lost() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    log = logging.Logger("busy")  # noqa: LOG001  of this test alone
    log.addHandler(handler := ThreadedHandler(writing, Lines(json_line)))
    log.error("odd", exc_info=KeyError("why"))
    for what in ("again", "again"):
        log.info(what)
    log.info("%d", "x")
    for number in range(13_000):
        log.info("line %d", number)
    data = b""
    while (told := sum(int(n or 1) for n in re.findall(rb'"line \d+|lost: (\d+)', data))) < 13_000:
        data += os.read(reading, 1 << 20)
    handler.close()
    os.close(writing)
    data += os.read(reading, 1 << 20)
    os.close(reading)
    assert told == 13_000
    for words in (b"KeyError: 'why'", b'"repeated":1,', b"cannot be formatted: TypeError"):
        assert words in data
