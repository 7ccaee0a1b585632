"""What the log says of vehicles and links, and of what is odd."""

import json
import logging
import sys
from math import inf
from typing import Any

import pytest

from mav_tasks.engine import inputs as i
from mav_tasks.engine.inputs import LinkSide, Packets
from mav_tasks.logs.field_notes import MOST_PEERS, PERIOD, FieldNotes
from mav_tasks.logs.lines import Lines, json_line
from mav_tasks.logs.vehicle_texts import BURST, TELL, VehicleTexts
from mav_tasks.logs.writing import ThreadedHandler
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder

ROVER = Encoder(Address(1, 1))


def heard(data: bytes, peer: Any = ("a", 1)) -> Packets:
    return Packets("rovers", [(peer, data)])


def text(words: str, number: int = 0) -> bytes:
    return ROVER.encode(m.Statustext(4, words.encode(), number))


def said(caplog: pytest.LogCaptureFixture, it: VehicleTexts | FieldNotes, *given: Any) -> list[str]:
    """Give an observer inputs at times; return what it logs until it is closed."""
    caplog.set_level(logging.DEBUG, "mav_tasks")
    for now, item in ((0.0, i.LinkChanged("rovers", LinkSide.VEHICLES, up=True)), *given):
        it.on_input(item, now=now)
    it.close()
    return caplog.messages


def test_texts_of_vehicles_are_said_once_whole_and_not_too_many(
    caplog: pytest.LogCaptureFixture,
) -> None:
    odd = heard(text("x")[:-1] + b"?"), heard(text(" \n")), heard(text("a" * 50, 7)), None
    found = said(
        *(caplog, VehicleTexts(), (0.1, heard(text("hot"))), (0.3, heard(text("hot"), "radio"))),
        *((10.0 * number, item) for number, item in enumerate(odd, 1)),
        *((50.0, heard(text(f"{n}"))) for n in range(BURST + 3)),
        (50.0 + TELL, None),
    )
    told = "hot", f"{'a' * 50}[…]", *map(str, range(BURST))
    assert found[:-1] == [f"rover 1 says: {words}" for words in told]
    assert found[-1] == "rover 1 sends too many texts: 3 omitted"


def test_who_is_heard_is_told_once_for_each_time_that_it_comes(
    caplog: pytest.LogCaptureFixture,
) -> None:
    found = said(
        *(caplog, FieldNotes(lambda: "many"), (0.0, heard(b"?")), (1.0, heard(b"?"))),
        (2.0, i.Congestion("rovers", "b", is_congested=True)),
        (4.0, i.PeerChanged("rovers", ("a", 1), up=True)),
        (PERIOD, heard(b"?")),
        *((PERIOD, heard(b"?", number)) for number in range(MOST_PEERS)),
        (PERIOD, heard(b"?")),
    )
    first = "link rovers for vehicles: first bytes from a:1"
    begin = ["link rovers for vehicles", first, "link rovers: b is congested", first]
    assert found[:5] == [*begin, "received so far: many"]
    assert found[-2:] == [first, "received so far: many"], "it was forgotten for all the others"


def say(handler: logging.Handler, words: str, *arguments: object, **more: Any) -> None:
    record = {"msg": words, "args": arguments, "levelno": 20, "levelname": "INFO", **more}
    handler.handle(logging.makeLogRecord(record))


def test_what_is_odd_is_one_line_all_the_same(capfd: pytest.CaptureFixture[str]) -> None:
    handler = ThreadedHandler(1, Lines(json_line))
    for at in (inf, 1e18):
        say(handler, f"{at}", created=at)
    say(handler, "%d", "no number")
    try:
        raise ZeroDivisionError
    except ZeroDivisionError:
        say(handler, "a\nb", exc_info=sys.exc_info())
    say(handler, "a\nb")
    handler.close()
    *odd, wrong, failed, again = filter(None, capfd.readouterr().out.splitlines())
    assert [json.loads(line)["time"] for line in odd] == [None, None]
    assert wrong.startswith("a log line cannot be formatted: TypeError(")
    assert "ZeroDivisionError" in json.loads(failed)["traceback"]
    assert json.loads(again)["message"] == "a b (repeated 1 times in 0 s)"
