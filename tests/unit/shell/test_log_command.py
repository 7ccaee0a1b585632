"""Every kind of event becomes words, a JSON object and a row of a table: ``mav-tasks log``."""

import csv
import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from typing import Any

import pytest
from typer.testing import CliRunner

from mav_tasks.basics.errors import UsageError
from mav_tasks.cli.app import app
from mav_tasks.config.settings import Retention
from mav_tasks.kinds import Drive, GlobalPlace, GoTo, Move, Pose, Wait
from mav_tasks.store.opening import kind_of
from mav_tasks.tasks import events as e
from mav_tasks.tasks.events import ParameterSet, SignatureRefused, SignaturesSeen
from mav_tasks.tasks.goal import Goal, Plan
from mav_tasks.tasks.lifecycle import TaskReason, TaskState
from mav_tasks.tasks.task import Frame, Marks, Progress, Submitter, Task, TaskId, Terms
from mav_tasks.tasks.timing import Timing

SOMEBODY = Submitter("udpin:127.0.0.1:14560", "127.0.0.1:50000", 255, 190)
AT, TIME = 100.25, "2026-11-21T10:00:00.250Z"
OFFSET = 1_795_255_200.25 - AT
ID = TaskId(17)
PROGRESS = Progress(Pose(1.0, 2.0, 0.5), frame=Frame(470_000_000, None, AT - 50))
WAY = GoTo(GlobalPlace(470_000_000, 80_000_000), speed=0.5)
EXECUTING, PAUSED = TaskState.EXECUTING, TaskState.PAUSED


def submitted(
    goal: Goal, number: int, label: str = "", deadline: float = AT + 60
) -> e.TaskSubmitted:
    terms = Terms(deadline=deadline, label=label)
    task = Task(TaskId(number), 1, 54000, goal, SOMEBODY, Marks(number), AT, terms)
    return e.TaskSubmitted(task, AT)


def changed(new: TaskState, reason: TaskReason, actor: str = "server") -> e.TaskChanged:
    return e.TaskChanged(ID, 1, 3, EXECUTING, new, reason, actor, AT, PROGRESS)


TIMING = Timing(0.05, 136, 0.05, 0.0512, 0.15, 1, (500, 135, 1500, 1))
FIGURES = {"count": 136, "p50": 0.05, "p99": 0.0512, "longest": 0.15, "late": 1}
FULL = "STOP in force: press Continue first"
REFUSED = e.SubmissionRefused(1, 54000, TaskReason.QUEUE_FULL, FULL, "255/190@a", AT)
HOME = Frame(None, None, AT - 50)
EVENTS: list[e.Event] = [
    submitted(Move(3.0), 17),
    submitted(Drive(0.5, 0.25, 2.0), 18),
    submitted(Plan((Wait(1.0), WAY), "source"), 19, "patrol", 1e300),
    changed(PAUSED, TaskReason.LINK_LOST),
    replace(changed(PAUSED, TaskReason.LINK_LOST), timing=TIMING),
    changed(TaskState.CANCELLED, TaskReason.CANCELLED, "255/190@a"),
    changed(TaskState.FAILED, TaskReason.STUCK),
    e.TaskAdvanced(ID, 1, 4, PROGRESS, AT),
    e.StepReached(ID, 1, 2, True, AT, 3),
    e.PlanStored(1, 0, 5, "source", "a", AT),
    e.TaskModified(ID, 1, 2, Terms(priority=9), "a", AT),
    e.TaskAssigned(ID, 2, 3, 1, "rover 1: silent; free", AT),
    e.TaskWaits(ID, 1, TaskReason.DISARMED, AT),
    e.TaskWithdrawn(ID, 1, AT),
    REFUSED,
    e.QueuePaused(1, TaskReason.STOPPED, "a", AT),
    e.QueueContinued(1, "a", AT),
    e.VehicleIdentified(1, "uid", AT),
    e.VehicleArmingSet(1, False, AT),
    e.VehicleSpeedSet(1, 0.5, "a", AT),
    e.VehicleHomeSet(1, 473_977_418, 85_455_938, HOME, "a", AT),
    ParameterSet("SPEED", 0.5, "a", AT),
    e.VehicleHalted(1, 7, TaskReason.OPERATOR, "a", AT),
    SignatureRefused("a signed anna", 90.0, AT),
    e.VehicleSeen(1, "found", AT),
    e.VehicleNoted(1, "a\x1b[31mb\r\nc\x07\u202ed\x9b é", AT),
    e.ServerStopped((1, 2), AT),
    e.ActTold(ID, 1, 2, AT, 3),
]
#: what the object of each says besides event, time, level, message and vehicle
SAID = rf""""task": 17, "actor": "{SOMEBODY}", "state": "queued"
"task": 18
"task": 19
"task": 17, "old": "executing", "new": "paused", "reason": "link_lost"
"task": 17, "timing": {json.dumps({"period": 0.05} | FIGURES)}
"level": "info"
"level": "warning"
"task": 17, "version": 4
"task": 17, "step": 2, "performs": true, "item": 3
"kind": 0, "plan_id": 5, "actor": "a"
"actor": "a", "version": 2
"task": 17, "before": 1, "choice": "rover 1: silent; free", "version": 3
"task": 17, "reason": "disarmed"
"task": 17
"command": 54000, "reason": "queue_full", "level": "warning", "text": "{FULL}"
"reason": "stopped", "actor": "a", "level": "warning"
"actor": "a"
"uid": "uid"
"may_arm": false
"speed": 0.5, "actor": "a"
"latitude_degE7": 473977418, "longitude_degE7": 85455938, "actor": "a"
"name": "SPEED", "value": 0.5, "actor": "a"
"epoch": 7, "level": "debug"
"actor": "a signed anna", "seconds": 90.0
"text": "found"
"level": "warning"
"unconfirmed": [1, 2]
"task": 17, "step": 2, "item": 3"""
VALUES = [json.loads(f"{{{row}}}") for row in SAID.splitlines()]

#: the first that differ from what their event says of itself
WORDS = {
    0: f"rover 1: task 17 submitted: move 3 m, priority 5, by {SOMEBODY}",
    2: f"rover 1: task 19 submitted: plan of 2 items 'patrol', priority 5, by {SOMEBODY}",
    4: "rover 1: task 17 paused: rover silent; "
    "136 setpoints at 20 Hz: p50 50.0, p99 51.2, max 150.0 ms, 1 late",
    5: "rover 1: task 17 cancelled by 255/190@a",
    14: "rover 1: command 54000 by 255/190@a refused: STOP in force: run 'mav-tasks resume' first",
    25: "rover 1: a[31mb  cd é",
}


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., list[str]]:
    path = str(tmp_path_factory.mktemp("log") / "tasks.sqlite3")
    with closing(kind_of(path).open_store(path, lambda: OFFSET, Retention())) as store:
        store.append(EVENTS)

    def lines(*options: str) -> list[str]:
        command = ["log", "--store", path, *options]
        result = CliRunner().invoke(app, command, catch_exceptions=False)
        assert result.exit_code == 0
        return [line for line in result.stdout.split("\n") if line]

    return lines


def strictly(line: str) -> dict[str, Any]:
    """Read one JSON object as a strict reader does, to which NaN is none."""
    return json.loads(line, parse_constant=pytest.fail)  # type: ignore[no-any-return]


def test_every_kind_is_an_object_with_its_values_and_words(log: Callable[..., list[str]]) -> None:
    not_in_journal = {e.TaskProgressed, SignaturesSeen}
    assert {type(event) for event in EVENTS} == set(e.Event.__args__) - not_in_journal
    found = [strictly(line) for line in log("--json")]
    for number, (event, values, told) in enumerate(zip(EVENTS, VALUES, found, strict=True)):
        assert told.items() >= values.items()
        assert (told["event"], told["time"]) == (type(event).__name__, TIME)
        assert told["message"] == WORDS.get(number, str(event))
        of_none = ParameterSet | e.ServerStopped | SignatureRefused
        assert "vehicle" in told or isinstance(event, of_none)
    deadlines = [each["terms"]["deadline"] for each in found[:3]]
    assert deadlines == [*["2026-11-21T10:01:00.250Z"] * 2, None]
    assert found[1]["goal"] == {"kind": "Drive", "forward": 0.5, "yaw_rate": 0.25, "duration": 2.0}
    assert (found[2]["goal"]["kind"], found[2]["goal"]["steps"]) == ("Plan", 2)


def test_the_table_has_a_row_of_each(log: Callable[..., list[str]]) -> None:
    rows = list(csv.DictReader(log("--csv")))
    for number, (event, values, row) in enumerate(zip(EVENTS, VALUES, rows, strict=True)):
        assert (row["number"], row["time"]) == (str(number + 1), TIME)
        assert row["words"] == WORDS.get(number, str(event))
        for name in {"task", "old", "new", "reason", "actor"} & values.keys():
            assert row[name] == str(values[name])
    assert {name: float(rows[4][name]) for name in FIGURES} == FIGURES
    assert {rows[3][name] for name in FIGURES} == {""}


def test_a_line_has_the_time_and_names_and_gives_no_orders(log: Callable[..., list[str]]) -> None:
    lines = log()
    assert f"{TIME} rover 1: a[31mb  cd é" in lines
    assert f"{TIME} rover 1: task 17 cancelled by a ground station at a" in lines
    assert all(line.startswith(TIME) and line.isprintable() for line in lines)


def test_since_and_until_when(log: Callable[..., list[str]]) -> None:
    for since in ("2026-11-21", "2026-11-21T10:00", "2026-11-21T11:00+01:00", "9999d"):
        assert len(log("--since", since)) == len(log())
    assert log("--since", "2026-11-21T10:01") == log("--until", "2026-11-21T10:00") == []
    for text in ("", "2", "2x", "-2h", "yesterday", "2026-13-01"):
        with pytest.raises(UsageError, match="--since"):
            log(f"--since={text}")
