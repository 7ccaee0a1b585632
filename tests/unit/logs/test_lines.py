"""The server's log beside its events: who is heard, what rovers say, and what a reader misses."""

import json
import logging
import os
import re

import pytest

from mav_tasks.engine.inputs import Congestion, LinkChanged, LinkSide, Packets, PeerChanged
from mav_tasks.logs.field_notes import FieldNotes
from mav_tasks.logs.lines import Lines, json_line
from mav_tasks.logs.unreadable import Unreadable
from mav_tasks.logs.vehicle_texts import VehicleTexts
from mav_tasks.logs.writing import ThreadedHandler
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.messages import Statustext

A, B = ("127.0.0.1", 14580), "radio"
HEARD = """link x for vehicles
rover 1 says: hot
link x for vehicles: first bytes from 127.0.0.1:14580
link x for vehicles: first bytes from radio
rover 1 says: cut...............................................[…]
link x: radio is congested
received so far: many
link x for vehicles: first bytes from radio
link x for vehicles: first bytes from 127.0.0.1:14580
link x: 80 bytes came from 127.0.0.1:14580 in 9 s"""


def text(words: str, number: int = 0) -> bytes:
    return Encoder(Address(1, 1)).encode(Statustext(4, words.encode(), number))


def test_who_is_heard_and_what_rovers_say_is_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    crowd = [(("::1", port), b"?") for port in range(300)]
    observers = VehicleTexts(), FieldNotes(lambda: "many"), Unreadable()
    caplog.set_level(logging.DEBUG, "mav_tasks")
    for now, item in (
        (0, LinkChanged("x", LinkSide.VEHICLES, up=True)),
        (0, Packets("x", [(A, text("hot")), (B, text("hot")), (A, text("broken")[:-1] + b"?")])),
        (1, Packets("x", [(A, text(" \n")), (A, text("cut".ljust(50, "."), 5))])),
        (70, Congestion("x", B, is_congested=True)),
        (70, PeerChanged("x", B, up=True)),
        (70, Packets("x", [(B, b"?"), *crowd])),
        (71, Packets("x", [(A, b"?" * 40)])),
        (80, Packets("x", [(A, b"?" * 40)])),
    ):
        for observer in observers:
            observer.on_input(item, now=now)
    told = [each.split(", and not")[0] for each in caplog.messages if "::1" not in each]
    assert "\n".join(told) == HEARD


def test_a_log_that_nobody_reads_says_how_many_lines_are_lost() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    handler = ThreadedHandler(writing, Lines(json_line))

    def say(words: str, *args: object, **more: object) -> None:
        record = {"msg": words, "args": args, "levelno": 20, "levelname": "INFO"}
        handler.handle(logging.makeLogRecord(record | more))

    say("odd", exc_info=(KeyError, KeyError("why"), None))
    for words in ("again", "again", "%d"):
        say(words, *(["x"] if "%" in words else []))
    for number in range(13_000):
        say("line %d", number)
    data = b""

    def told() -> int:
        lost = sum(map(int, re.findall(rb"lines lost: (\d+)", data)))
        return lost + len(re.findall(rb'"line \d+"', data))

    while told() < 13_000 or b"lost" not in data:
        data += os.read(reading, 1 << 20)
    handler.close()
    os.close(writing)
    data += os.read(reading, 1 << 20)
    os.close(reading)
    assert told() == 13_000
    lines = data.decode().splitlines()
    assert sum("cannot be formatted: TypeError" in line for line in lines) == 1
    said = [json.loads(line) for line in lines if "cannot be" not in line]
    assert said[0]["traceback"].endswith("KeyError: 'why'")
    assert [each["repeated"] for each in said if "again (" in each["message"]] == [1]
