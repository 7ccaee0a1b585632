"""What the log says of vehicles and links, and that whoever logs never waits for its reader."""

import json
import logging
import os
import sys
import time
from dataclasses import replace
from math import inf

import pytest

from mav_tasks.engine import inputs as i
from mav_tasks.engine.inputs import Input, LinkSide, Packets
from mav_tasks.logs.field_notes import MOST_PEERS, PERIOD, FieldNotes
from mav_tasks.logs.lines import Lines, TextLines, json_line
from mav_tasks.logs.unreadable import Unreadable
from mav_tasks.logs.vehicle_texts import BURST, TELL, VehicleTexts
from mav_tasks.logs.writing import MOST, ThreadedHandler
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.tasks.goal import Move
from tests.unit.logs.test_log_command import submitted

PEER = ("10.0.0.2", 14550)
ROVERS = i.LinkChanged("rovers", LinkSide.VEHICLES, up=True)
ROVER = Encoder(Address(1, 1))


def text(words: str, number: int = 0, peer: object = PEER) -> Packets:
    message = m.Statustext(4, words.encode(), number)
    return Packets("rovers", [(peer, ROVER.encode(message))])


def said(
    caplog: pytest.LogCaptureFixture,
    it: VehicleTexts | FieldNotes | Unreadable,
    *given: tuple[float, Input | None],
) -> list[str]:
    """Give an observer inputs; return what it logs until it is closed."""
    with caplog.at_level(logging.DEBUG, "mav_tasks"):
        for now, item in ((0.0, ROVERS), *given):
            it.on_input(item, now=now)
        it.close()
    return [record.getMessage() for record in caplog.records]


def test_texts_of_vehicles_are_said_once_whole_and_not_too_many(
    caplog: pytest.LogCaptureFixture,
) -> None:
    broken = Packets("rovers", [(PEER, text("x").datagrams[0][1][:-1] + b"?")])
    begin = "a" * 50
    found = said(
        *(caplog, VehicleTexts(), (0.1, text("hot")), (0.3, text("hot", peer="radio"))),
        *((1.0, broken), (1.0, text(" \n")), (2.0, text(begin, 7)), (9.0, None)),
        *((20.0, text(f"number {n}")) for n in range(BURST + 3)),
        (20.0 + TELL, None),
    )
    numbers = [f"rover 1 says: number {n}" for n in range(BURST)]
    first = ["rover 1 says: hot", f"rover 1 says: {begin}[…]"]
    assert found == [*first, *numbers, "rover 1 sends too many texts: 3 omitted"]


def test_who_is_heard_and_who_sends_no_packets_is_told(caplog: pytest.LogCaptureFixture) -> None:
    one = Packets("rovers", [(PEER, b"?")])
    found = said(
        *(caplog, FieldNotes(lambda: "many"), (0.0, one), (1.0, one)),
        (2.0, i.Congestion("rovers", "ttyS0", is_congested=True)),
        (3.0, i.Congestion("rovers", "ttyS0", is_congested=False)),
        (4.0, i.PeerChanged("rovers", PEER, up=True)),
        (PERIOD, one),
    )
    first = "link rovers for vehicles: first bytes from 10.0.0.2:14550"
    assert found == [
        *("link rovers for vehicles", first, "link rovers: ttyS0 is congested"),
        *("link rovers: ttyS0 is no longer congested", first),
        *("received so far: many", "received so far: many"),
    ]
    caplog.clear()
    crowd = [Packets("rovers", [((f"10.0.0.{n}", 1), b"?")]) for n in range(MOST_PEERS)]
    notes = said(caplog, FieldNotes(str), *((0.0, item) for item in (one, *crowd, one)))
    assert notes.count(first) == 2, "the first was forgotten for the last"
    caplog.clear()
    late = Packets("rovers", [(PEER, b"?" * 40)])
    given = [(0.0, one), *((0.0, item) for item in crowd), (6.0, late), (9.0, one), (12.0, late)]
    (words,) = said(caplog, Unreadable(), *given)
    assert words.startswith("link rovers: 81 bytes came from 10.0.0.2:14550 in 6 s, and not one")


def say(handler: logging.Handler, words: object, *arguments: object, **more: object) -> None:
    record = {"msg": words, "args": arguments, "levelno": 20, "levelname": "INFO", **more}
    handler.handle(logging.makeLogRecord(record))


def test_who_logs_does_not_wait_for_a_reader_and_what_is_lost_is_counted() -> None:
    read, write = os.pipe()
    os.set_blocking(write, False)
    handler = ThreadedHandler(write, Lines(json_line))
    begun = time.monotonic()
    for number in range(2 * MOST):  # more than the pipe and the queue take
        say(handler, f"line {number}")
    assert time.monotonic() - begun < 5.0
    data = b""
    while b"lost: " not in data:
        data += os.read(read, 1 << 20)
        say(handler, "once more")
    handler.close()
    lines = [json.loads(line)["message"] for line in data.splitlines()[:1_000]]
    assert lines == [f"line {number}" for number in range(1_000)]
    os.close(read)
    os.close(write)


def test_what_is_odd_is_one_line_all_the_same(capfd: pytest.CaptureFixture[str]) -> None:
    told = submitted(Move(3.0), 17)
    times = [told.task.terms.deadline, inf, 1e18]
    odd = [replace(told.task, terms=replace(told.task.terms, deadline=at)) for at in times]
    handler = ThreadedHandler(1, Lines(json_line))
    for task in odd:
        say(handler, replace(told, task=task))
    say(handler, "%d", "no number")
    try:
        raise ZeroDivisionError("\x1b]0;title\x07")
    except ZeroDivisionError:
        say(handler, "a\nb", exc_info=sys.exc_info())
        say(handler, "a\nb")
        handler.close()
        text = ThreadedHandler(2, Lines(TextLines()))
        say(text, "a\nb", exc_info=sys.exc_info())
        say(text, "a\nb")
        text.close()
    out, err = capfd.readouterr()
    *events, wrong, failed, again = filter(None, out.splitlines())
    deadlines = [json.loads(line)["terms"]["deadline"] for line in events]
    assert [deadlines[0] is None, *deadlines[1:]] == [False, None, None]
    assert wrong.startswith("a log line cannot be formatted: TypeError(")
    assert "ZeroDivisionError" in json.loads(failed)["traceback"]
    assert json.loads(again)["message"] == "a b (repeated 1 times in 0 s)"
    assert [line[29:] for line in err.splitlines()[:1]] == [" INFO a b"]
    assert "ZeroDivisionError: ]0;title" in err.splitlines()
    lines = Lines(json_line)
    record = logging.makeLogRecord({"msg": "%d"})
    for number in range(2_001):  # more than are remembered: the oldest is told before its time
        record.args = (number // 2,)
        lines.of(record, now=0.0)
    assert len(list(lines.due(now=1.0))) == 1
