"""The report: what is not as it must be stands out, and JSON has no NaN."""

import json
from math import nan

from rich.console import Console

from mav_tasks.cli.probe_table import table_of
from mav_tasks.probe.findings import Drive, Findings, Rate
from mav_tasks.probe.report import Mark, as_json, lines_of

FOUND = Findings(
    system_id=3,
    autopilot="px4",
    vehicle_type=10,
    is_rover=True,
    parameters={"COM_OF_LOSS_T": nan, "RD_MAX_SPEED": 2.0},
    rates=[Rate("ATTITUDE", 25.0, 1.0, "DENIED", 1.0), Rate("SYS_STATUS", 1.0, 1.0)],
    prearm="not ok",
    prearm_texts=["PreArm: GPS", "PreArm: compass"],
    drive=Drive(ended="the rover was disarmed", left="Hold, ARMED", hold="no", loss_stop="no"),
)


def test_what_is_not_well_stands_out() -> None:
    marks = {line.topic: line.mark for line in lines_of(FOUND)}
    assert [topic for topic, mark in marks.items() if mark is Mark.BAD] == [
        "driving",
        "left in",
        "HOLD",
        "setpoints stop",
    ]
    assert (marks["ATTITUDE"], marks["arming checks"]) == (Mark.WARNING, Mark.WARNING)
    assert (marks["rover"], marks["firmware"]) == (Mark.GOOD, Mark.WARNING)


def test_what_was_not_tried_is_not_well_nor_ill() -> None:
    lines = {line.topic: line for line in lines_of(Findings(system_id=1))}
    assert lines["driving"].words == "not tried: needs --drive"
    assert lines["driving"].mark is Mark.PLAIN
    assert lines["rover"].mark is Mark.BAD


def test_json_is_json() -> None:
    text = json.dumps(as_json(FOUND), allow_nan=False)
    assert json.loads(text)["parameters"] == {"COM_OF_LOSS_T": None, "RD_MAX_SPEED": 2.0}


def test_a_narrow_terminal_loses_no_word() -> None:
    console = Console(width=50, force_terminal=True, color_system=None)
    with console.capture() as captured:
        console.print(table_of(lines_of(FOUND)))
    assert max(map(len, captured.get().splitlines())) <= 50
    shown = " ".join(captured.get().split())
    for word in ("PreArm:", "compass", "disarmed", "ARMED"):
        assert word in shown
